#pragma once

#include <vector>

#include "imaging/image_pyramid.hpp"
#include "tracking/common/dense_alignment.hpp"
#include "tracking/loss/wide_search.hpp"

namespace twofold {

/// What the last frame that had a pose saw.
struct LastFrame {
  FrameImages images;  ///< right and depth only if it became no keyframe
  std::vector<AlignmentPoint> points;
  FrameCorners corners;
  bool is_keyframe = false;  ///< with two cameras or depth its images are then among the recent views
  bool by_depth = false;     ///< TrackResult::by_depth
};

}  // namespace twofold
