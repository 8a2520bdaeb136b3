#pragma once

#include "calibration/calibrate.hpp"
#include "calibration/opencv_lens.hpp"

namespace twofold {

/// One camera by itself, as calibrate_camera gives it, with the lens in the form a stereo calibration starts
/// from.
struct AloneFit {
  CameraFit fit;
  Lens lens;
};
[[nodiscard]] tl::expected<AloneFit, std::string> calibrate_alone(const std::vector<BoardView>& views,
                                                                  const Board& board, cv::Size size,
                                                                  const CalibrationOptions& options);

}  // namespace twofold
