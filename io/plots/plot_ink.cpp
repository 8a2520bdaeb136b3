#include "io/plots/plot_ink.hpp"

#include <opencv2/imgproc.hpp>

namespace twofold::plot_ink {

void put_text(cv::Mat& canvas, const std::string& text, cv::Point at, double size, Anchor anchor,
              const cv::Scalar& colour, int weight) {
  const double scale = size * kSuper;
  int baseline = 0;
  const int width = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, scale, weight * kSuper, &baseline).width;
  if (anchor == Anchor::kCentre) at.x -= width / 2;
  if (anchor == Anchor::kRight) at.x -= width;
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, colour, weight * kSuper, cv::LINE_AA);
}

cv::Mat shrink(const cv::Mat& canvas) {
  cv::Mat image;
  cv::resize(canvas, image, {canvas.cols / kSuper, canvas.rows / kSuper}, 0, 0, cv::INTER_AREA);
  return image;
}

}  // namespace twofold::plot_ink
