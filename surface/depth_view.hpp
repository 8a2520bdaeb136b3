#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "camera/rig.hpp"

namespace twofold {

/// A depth image as fusion reads it.
struct DepthView {
  PinholeCamera camera;
  cv::Mat depth;  ///< CV_32FC1 [m]; 0: no reading
  cv::Mat
      nearest;  ///< CV_32FC1 [m]: the smallest depth of a pixel and its eight neighbours; 0 if one has none
  cv::Mat facing;  ///< CV_32FC1: cosine of the angle between ray and surface normal, in [0.1, 1]
  cv::Mat colour;  ///< CV_8UC3 (blue, green, red) or CV_8UC1; may be empty
};

/// Why a depth image, and a colour image beside it if it is not empty, do not fit the rig; empty when they
/// do. depth: CV_16UC1 in units of Rig::depth_unit, or CV_32FC1 [m]; colour: CV_8UC3 or CV_8UC1.
[[nodiscard]] std::string depth_defect(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour);

/// Prepares a depth image for fusion; it and colour must have no depth_defect. Readings that are not finite,
/// out of the rig's range, or beside a jump in depth, where sensors see a mixture of both sides, are left
/// out.
[[nodiscard]] DepthView make_depth_view(const Rig& rig, const cv::Mat& depth, const cv::Mat& colour);

/// Share of pixels with a reading, in [0, 1].
[[nodiscard]] double share_of_readings(const DepthView& view);

}  // namespace twofold
