#pragma once

#include <algorithm>

#include "tracking/common/effort.hpp"
#include "tracking/options.hpp"

namespace twofold {

/// What the tracker does on a frame at this level, as said beside EffortLevel.
[[nodiscard]] inline EffortBounds bounds_of(EffortLevel effort, const TrackerOptions& options) {
  EffortBounds bounds{options.local_map.wanted_matches,
                      options.local_map.max_searches,
                      options.alignment.finest_level,
                      true,
                      true,
                      options.pose.motion.max_iterations,
                      options.search.refine_iterations};
  if (effort >= EffortLevel::kFewerPoints) {
    bounds.wanted_matches = std::max(options.local_map.wanted_matches / 2, options.pose.min_inliers);
    bounds.max_searches = std::max(options.local_map.max_searches / 2, bounds.wanted_matches);
  }
  if (effort >= EffortLevel::kCoarseAlignment) {
    bounds.finest_alignment_level =
        std::min(options.alignment.finest_level + 2, options.alignment.coarsest_level);
    bounds.align_from_rest = false;
    bounds.doubts_poses = false;
  }
  if (effort >= EffortLevel::kFewerIterations) {
    bounds.motion_iterations = std::max(options.pose.motion.max_iterations / 3, 2);
    bounds.refine_iterations = std::max(options.search.refine_iterations / 3, 1);
    bounds.urgent_keyframes_only = true;
  }
  return bounds;
}

}  // namespace twofold
