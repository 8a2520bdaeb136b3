#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "imaging/image_pyramid.hpp"
#include "tracking/dense_alignment.hpp"
#include "tracking/frame_step.hpp"
#include "tracking/wide_search.hpp"

namespace twofold {

/// What the tracker remembers of the last frame that had a pose.
struct LastFrame {
  FrameImages images;  ///< right and depth only if it became no keyframe
  std::vector<AlignmentPoint> points;
  FrameCorners corners;
  std::int64_t t_ns = 0;
  Placement placement;
  SE3 T_this_previous;              ///< its motion, the prediction of the next; none after a loss
  double interval = 0;              ///< between the two [s]; 0 after a loss
  std::optional<Vector6> velocity;  ///< (v, omega) [m/s, rad/s], if the frame before it says
  bool is_keyframe = false;         ///< with two cameras or depth its images are then among the recent views
  bool by_depth = false;            ///< TrackResult::by_depth
};

}  // namespace twofold
