#include "twofold/estimate.hpp"

namespace twofold {

const char* to_string(TrackingState state) {
  switch (state) {
    case TrackingState::kTracked:
      return "tracked";
    case TrackingState::kLost:
      return "lost";
    case TrackingState::kUnplaced:
      break;
  }
  return "unplaced";
}

const char* to_string(MapEventKind kind) {
  switch (kind) {
    case MapEventKind::kOptimisation:
      return "optimisation";
    case MapEventKind::kLoopClosure:
      return "loop closure";
    case MapEventKind::kPoseGraph:
      return "pose graph";
    case MapEventKind::kPartsJoined:
      return "parts joined";
    case MapEventKind::kRelocalisation:
      return "relocalisation";
    case MapEventKind::kNewPart:
      break;
  }
  return "new part";
}

}  // namespace twofold
