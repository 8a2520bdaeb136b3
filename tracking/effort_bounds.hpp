#pragma once

#include <algorithm>

#include "tracking/common/effort.hpp"
#include "tracking/options.hpp"

namespace twofold {

/// What the tracker does on a frame at this level, as said beside EffortLevel.
[[nodiscard]] inline EffortBounds bounds_of(EffortLevel effort, const TrackerOptions& options) {
  const EffortBoundsOptions& by = options.effort;
  const auto part = [](double share, int whole) { return static_cast<int>(share * whole); };
  EffortBounds bounds{options.local_map.wanted_matches,
                      options.local_map.max_searches,
                      options.alignment.finest_level,
                      true,
                      true,
                      options.pose.motion.max_iterations,
                      options.search.refine_iterations};
  if (effort >= EffortLevel::kFewerPoints) {
    bounds.wanted_matches =
        std::max(part(by.points_share, options.local_map.wanted_matches), options.pose.min_inliers);
    bounds.max_searches =
        std::max(part(by.points_share, options.local_map.max_searches), bounds.wanted_matches);
  }
  if (effort >= EffortLevel::kCoarseAlignment) {
    bounds.finest_alignment_level =
        std::min(options.alignment.finest_level + by.coarse_levels, options.alignment.coarsest_level);
    bounds.align_from_rest = false;
    bounds.doubts_poses = false;
  }
  if (effort >= EffortLevel::kFewerIterations) {
    bounds.motion_iterations =
        std::max(part(by.iterations_share, options.pose.motion.max_iterations), by.min_motion_iterations);
    bounds.refine_iterations =
        std::max(part(by.iterations_share, options.search.refine_iterations), by.min_refine_iterations);
    bounds.urgent_keyframes_only = true;
  }
  return bounds;
}

}  // namespace twofold
