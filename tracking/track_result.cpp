#include "tracking/track_result.hpp"

namespace twofold {

const char* describe(TrackStage stage) {
  switch (stage) {
    case TrackStage::kPyramid:
      return "pyramid";
    case TrackStage::kAlignment:
      return "dense alignment";
    case TrackStage::kCandidates:
      return "candidates";
    case TrackStage::kSearch:
      return "guided search";
    case TrackStage::kMotion:
      return "motion-only adjustment";
    case TrackStage::kKeyframe:
      return "keyframe";
    case TrackStage::kCount:
      break;
  }
  return "";
}

}  // namespace twofold
