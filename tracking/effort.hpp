#pragma once

#include <algorithm>
#include <cstdint>

#include "tracking/options.hpp"

namespace twofold {

/// How much work the tracker does on a frame, from most to least. Each level does less, as said beside it,
/// and as the levels above it do.
enum class EffortLevel : std::uint8_t {
  kEverything,
  kFewerPoints,      ///< half of the points are searched
  kCoarseAlignment,  ///< dense alignment stops two levels above the finest, and starts once only; a pose that
                     ///< few points agree on is taken as it is
  kFewerIterations,  ///< a third of the solver's and the patch search's iterations; no keyframes of frames
                     ///< that points placed, unless tracking would soon be lost without one or the map has
                     ///< one keyframe only: they are the most expensive frames, and the mapper, which works
                     ///< on them, needs the same processors
  kDropFrames,       ///< frames whose successor is due, if LatePolicy allows it
  kCount
};
inline constexpr int kEffortLevels = static_cast<int>(EffortLevel::kCount);

[[nodiscard]] constexpr const char* describe(EffortLevel effort) {
  switch (effort) {
    case EffortLevel::kEverything:
      return "everything";
    case EffortLevel::kFewerPoints:
      return "fewer points";
    case EffortLevel::kCoarseAlignment:
      return "coarse alignment";
    case EffortLevel::kFewerIterations:
      return "fewer iterations";
    case EffortLevel::kDropFrames:
      return "drop frames";
    case EffortLevel::kCount:
      break;
  }
  return "";
}

/// Upper bounds of one frame's work.
struct EffortBounds {
  int wanted_matches = 0;
  int max_searches = 0;
  int finest_alignment_level = 0;
  bool align_from_rest = true;  ///< a second time, when the first start did not fit
  bool doubts_poses = true;     ///< and looks for better ones by appearance, which costs most of all
  int motion_iterations = 0;
  int refine_iterations = 0;
  bool urgent_keyframes_only = false;  ///< see KeyframeDecisionOptions::urgent_share
};

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
