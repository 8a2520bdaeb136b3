#pragma once

#include <string>
#include <vector>

#include "calibration/calibrate.hpp"
#include "calibration/view_shape.hpp"

namespace twofold {

// Why a calibration is refused, and what the person can do about it. Each is empty when nothing speaks
// against.

/// Before anything is solved: too few views, corners in too little of the image.
[[nodiscard]] std::string refusal_of_views(const std::vector<BoardView>& views, cv::Size size,
                                           const CalibrationOptions& options);
/// All views alike: an unturned plane at twice the distance looks as under twice the focal length.
[[nodiscard]] std::string refusal_of_tilts(const std::vector<ViewShape>& shapes,
                                           const CalibrationOptions& options);
[[nodiscard]] std::string refusal_of_error(double rms_px, const CalibrationOptions& options);
/// Error, uncertain focal length, a distortion that folds the image over.
[[nodiscard]] std::string refusal_of_fit(const CameraFit& fit, const CalibrationOptions& options);
/// @param deviation  one standard deviation [m]
[[nodiscard]] std::string refusal_of_baseline(double baseline, double deviation,
                                              const CalibrationOptions& options);

}  // namespace twofold
