#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace twofold {

/// Residuals of one camera, for drawing.
struct ResidualPanel {
  std::string title;
  cv::Size size;                               ///< of the camera's images [px]
  std::vector<cv::Point2f> pixels, residuals;  ///< of the same length [px]
};

/// Panels side by side: an arrow at each corner, drawn `magnified` times as long as it is, over the area of
/// the image. Arrows that point one way together show what the lens model cannot explain; noise points
/// anywhere. CV_8UC3.
[[nodiscard]] cv::Mat draw_residuals(const std::vector<ResidualPanel>& panels, double magnified = 60);

}  // namespace twofold
