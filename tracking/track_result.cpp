#include "tracking/track_result.hpp"

namespace twofold {

const char* describe(LostCause cause) {
  switch (cause) {
    case LostCause::kNone:
      return "";
    case LostCause::kNoTexture:
      return "too few corners with depth to start a map";
    case LostCause::kTooFewCandidates:
      return "hardly any map point should be visible";
    case LostCause::kTooFewMatches:
      return "visible map points were not found (blur, occlusion, exposure)";
    case LostCause::kInconsistentMatches:
      return "found points do not agree on a pose";
    case LostCause::kNoKeyframeBuffer:
      return "no free buffer to start the map with";
    case LostCause::kUnplaced:
      return "no place of the loaded map was recognised yet";
  }
  return "";
}

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
