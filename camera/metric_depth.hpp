#pragma once

#include <opencv2/core/mat.hpp>

namespace twofold {

/// A depth image in metres (CV_32FC1; what is not finite or not above zero: no reading) in the units that
/// frames have (CV_16UC1, 0: no reading). What is farther than 65535 of them is no reading, either.
/// @param unit  Rig::depth_unit [m] > 0
[[nodiscard]] cv::Mat in_depth_units(const cv::Mat& metres, double unit);

}  // namespace twofold
