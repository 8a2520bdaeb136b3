#pragma once

#include <opencv2/core/mat.hpp>

#include "camera/rig.hpp"

namespace twofold {

/// How near a place may come to a pair by default [m].
inline constexpr double kNearestStereo = 0.4;

/// Depth from a rectified pair by semi-global matching  (Hirschmueller, PAMI 2008; OpenCV's), then
/// refine_disparity.
///
/// A disparity is kept where the match from the right image to the left agrees with it to a pixel, where it
/// is no speck of its own, where its standard deviation is at most a fifth of a pixel, and not within two
/// pixels of something farther, because matching widens what is near. Below two pixels it is noise: depth
/// ends at f b / 2, and at 65535 units.
/// @param left, right  CV_8UC1 of the rig's size
/// @param nearest      disparities are searched up to that of this depth [m] > 0, or up to 0.4 of the image's
///                     width, whichever is less; Rig::depth_min and depth_max are make_depth_view's matter
/// @return  CV_16UC1 in units of rig.depth_unit, 0: none
[[nodiscard]] cv::Mat stereo_depth(const Rig& rig, const cv::Mat& left, const cv::Mat& right, double nearest);

}  // namespace twofold
