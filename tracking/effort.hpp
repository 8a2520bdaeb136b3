#pragma once

#include <algorithm>
#include <cstdint>

#include "tracking/options.hpp"

namespace twofold {

/// Rungs of the load ladder, in the order in which work is left out. Each keeps what the ones before it left
/// out.
enum class LadderRung : std::uint8_t {
  kEverything,
  kFewerPoints,      ///< half of the points are searched
  kCoarseAlignment,  ///< dense alignment stops two levels above the finest, and starts once only
  kFewerIterations,  ///< a third of the solver's and the patch search's iterations; keyframes only when
                     ///< tracking would soon be lost without: they are the dearest frames, and the mapper
                     ///< that works on them wants the same processors
  kDropFrames,       ///< as before; frames whose successor is due are dropped, if the policy allows it
  kCount
};
inline constexpr int kLadderRungs = static_cast<int>(LadderRung::kCount);

[[nodiscard]] constexpr const char* describe(LadderRung rung) {
  switch (rung) {
    case LadderRung::kEverything:
      return "everything";
    case LadderRung::kFewerPoints:
      return "fewer points";
    case LadderRung::kCoarseAlignment:
      return "coarse alignment";
    case LadderRung::kFewerIterations:
      return "fewer iterations";
    case LadderRung::kDropFrames:
      return "drop frames";
    case LadderRung::kCount:
      break;
  }
  return "";
}

/// Upper bounds of one frame's work.
struct TrackEffort {
  int wanted_matches = 0;
  int max_searches = 0;
  int finest_alignment_level = 0;
  bool align_from_rest = true;  ///< a second time, when the first start did not fit
  int motion_iterations = 0;
  int refine_iterations = 0;
  bool urgent_keyframes_only = false;  ///< see TrackerOptions::urgent_share
};

[[nodiscard]] inline TrackEffort effort_on(LadderRung rung, const TrackerOptions& options) {
  TrackEffort effort{options.wanted_matches,         options.max_searches,
                     options.alignment.finest_level, true,
                     options.motion.max_iterations,  options.search.refine_iterations};
  if (rung >= LadderRung::kFewerPoints) {
    effort.wanted_matches = std::max(options.wanted_matches / 2, options.min_inliers);
    effort.max_searches = std::max(options.max_searches / 2, effort.wanted_matches);
  }
  if (rung >= LadderRung::kCoarseAlignment) {
    effort.finest_alignment_level =
        std::min(options.alignment.finest_level + 2, options.alignment.coarsest_level);
    effort.align_from_rest = false;
  }
  if (rung >= LadderRung::kFewerIterations) {
    effort.motion_iterations = std::max(options.motion.max_iterations / 3, 1);
    effort.refine_iterations = std::max(options.search.refine_iterations / 3, 1);
    effort.urgent_keyframes_only = true;
  }
  return effort;
}

}  // namespace twofold
