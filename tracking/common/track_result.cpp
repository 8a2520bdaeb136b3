#include "tracking/common/track_result.hpp"

namespace twofold {

const char* describe(TrackerStage stage) {
  switch (stage) {
    case TrackerStage::kPyramid:
      return "pyramid";
    case TrackerStage::kAlignment:
      return "dense alignment";
    case TrackerStage::kCandidates:
      return "candidates";
    case TrackerStage::kSearch:
      return "guided search";
    case TrackerStage::kMotion:
      return "motion-only adjustment";
    case TrackerStage::kKeyframe:
      return "keyframe";
    case TrackerStage::kCount:
      break;
  }
  return "";
}

}  // namespace twofold
