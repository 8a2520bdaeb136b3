#include "io/plots/plot_ink.hpp"

#include <opencv2/imgproc.hpp>

namespace twofold::plot_ink {

namespace {

int text_width(const std::string& text, double size, int weight) {
  int baseline = 0;
  return cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size * kSuper, weight * kSuper, &baseline).width;
}

}  // namespace

void put_text(cv::Mat& canvas, const std::string& text, cv::Point at, double size, Anchor anchor,
              const cv::Scalar& colour, int weight) {
  const int width = text_width(text, size, weight);
  if (anchor == Anchor::kCentre) at.x -= width / 2;
  if (anchor == Anchor::kRight) at.x -= width;
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size * kSuper, colour, weight * kSuper,
              cv::LINE_AA);
}

std::string shortened(const std::string& text, double size, int width) {
  std::string kept = text;
  for (std::size_t letters = text.size(); letters > 0 && text_width(kept, size, 1) > width * kSuper;
       --letters) {
    const std::size_t front = letters / 2;
    kept = text.substr(0, front) + "..." + text.substr(text.size() - (letters - front));
  }
  return kept;
}

cv::Mat shrink(const cv::Mat& canvas) {
  cv::Mat image;
  cv::resize(canvas, image, {canvas.cols / kSuper, canvas.rows / kSuper}, 0, 0, cv::INTER_AREA);
  return image;
}

}  // namespace twofold::plot_ink
