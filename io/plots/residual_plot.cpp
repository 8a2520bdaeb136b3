#include "io/plots/residual_plot.hpp"

#include <opencv2/imgproc.hpp>

#include <fmt/format.h>

#include "io/plots/plot_ink.hpp"

namespace twofold {
namespace {

using namespace plot_ink;

constexpr int kWidth = 640, kMargin = 24, kHeader = 64, kFooter = 36;  // [px] of the picture

void draw_panel(cv::Mat& canvas, const ResidualPanel& panel, int left, double magnified) {
  const double scale = static_cast<double>(kSuper * kWidth) / panel.size.width;
  const cv::Rect inside(left, kSuper * kHeader, kSuper * kWidth, static_cast<int>(scale * panel.size.height));
  cv::rectangle(canvas, inside, kInk, kSuper);
  put_text(canvas, panel.title, {left, kSuper * (kHeader - 12)}, 0.5, Anchor::kLeft, {20, 20, 20});
  const auto point = [&](const cv::Point2f& p, const cv::Point2f& r) {
    return cv::Point(inside.x + cvRound(scale * (p.x + magnified * r.x)),
                     inside.y + cvRound(scale * (p.y + magnified * r.y)));
  };
  for (std::size_t i = 0; i < panel.pixels.size(); ++i) {
    const cv::Point from = point(panel.pixels[i], {0, 0});
    cv::line(canvas, from, point(panel.pixels[i], panel.residuals[i]), {200, 90, 20}, kSuper, cv::LINE_AA);
    cv::circle(canvas, from, kSuper, kInk, cv::FILLED, cv::LINE_AA);
  }
}

}  // namespace

cv::Mat draw_residuals(const std::vector<ResidualPanel>& panels, double magnified) {
  int height = 0;
  for (const ResidualPanel& panel : panels)
    height = std::max(height, kSuper * kWidth * panel.size.height / std::max(panel.size.width, 1));
  const int columns = static_cast<int>(panels.size());
  cv::Mat canvas(height + kSuper * (kHeader + kFooter), kSuper * (columns * (kWidth + kMargin) + kMargin),
                 CV_8UC3, kWhite);
  for (int c = 0; c < columns; ++c)
    draw_panel(canvas, panels[static_cast<std::size_t>(c)], kSuper * (kMargin + c * (kWidth + kMargin)),
               magnified);
  // Half a pixel of the first camera, magnified.
  const int bar = columns == 0 ? 0 : cvRound(0.5 * magnified * kSuper * kWidth / panels[0].size.width);
  const int y = canvas.rows - kSuper * 14;
  cv::line(canvas, {kSuper * kMargin, y}, {kSuper * kMargin + bar, y}, {200, 90, 20}, 2 * kSuper,
           cv::LINE_AA);
  put_text(canvas, "0.5 px", {kSuper * (kMargin + 8) + bar, y + kSuper * 4}, 0.42, Anchor::kLeft);
  return shrink(canvas);
}

}  // namespace twofold
