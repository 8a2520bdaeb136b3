#pragma once

#include <opencv2/core/mat.hpp>

#include "camera/rig.hpp"
#include "surface/options.hpp"
#include "twofold/surface.hpp"

namespace twofold {

/// What surfaces take of a frame.
struct DepthFrame {
  cv::Mat depth;   ///< CV_16UC1, over the caller's pixels
  cv::Mat colour;  ///< or brightness
};

/// How the depth of a pair is found.
struct PairMatching {
  double min_depth = 0;   ///< SurfaceModelOptions::min_stereo_depth
  double row_offset = 0;  ///< rows that the right image lies lower, taken back before [px]
};

/// Of a depth image, or of a pair by semi-global matching. Throws std::invalid_argument saying what is wrong
/// with the images.
[[nodiscard]] DepthFrame depth_frame(const Rig& rig, const FrameView& frame, const PairMatching& matching);

/// Throws std::invalid_argument for a rig without depth.
[[nodiscard]] Rig expect_depth(const Rig& rig);
/// Throws std::invalid_argument for options that are not valid.
[[nodiscard]] SurfaceOptions surface_options(const Rig& rig, const SurfaceModelOptions& options);

}  // namespace twofold
