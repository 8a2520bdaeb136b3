#pragma once

#include <cstdint>

namespace twofold {

/// How much work the tracker does on a frame, from most to least. Each level does less, as said beside it,
/// and as the levels above it do; by how much, EffortBoundsOptions say.
enum class EffortLevel : std::uint8_t {
  kEverything,
  kFewerPoints,      ///< a part of the points is searched
  kCoarseAlignment,  ///< dense alignment stops some levels above the finest, and starts once only; a pose
                     ///< that few points agree on is taken as it is
  kFewerIterations,  ///< a part of the solver's and the patch search's iterations; no keyframes of frames
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

}  // namespace twofold
