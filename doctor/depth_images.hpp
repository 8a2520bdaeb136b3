#pragma once

#include <opencv2/core/mat.hpp>
#include <span>

#include "camera/rig.hpp"
#include "doctor/finding.hpp"

namespace twofold {

/// Whether depth images hold depth, and how much of it lies where the rig's depth_min and depth_max are:
/// most, unless the unit is wrong.
///
/// @param images  CV_16UC1, in the rig's depth_unit, 0 where there is none; at least one
[[nodiscard]] Finding check_depth(std::span<const cv::Mat> images, const Rig& rig);

}  // namespace twofold
