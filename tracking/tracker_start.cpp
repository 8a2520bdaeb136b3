// Where tracking starts: a new map, a loaded one, a new part of it.
#include "tracking/tracker.hpp"

namespace twofold {

void Tracker::continue_from(const GraphSnapshot& graph, const std::optional<AssumedPose>& assumed) {
  if (graph.keyframe_count() == 0) return;
  proposer_.continue_from(graph);
  if (assumed) assumed_ = AssumedPlacements(graph, *assumed);
  unplaced_ = true;
}

bool Tracker::start_map(FrameStep& step) {
  step.result.cause = make_first_keyframe(step);
  if (step.result.cause == LostCause::kNoTexture && rig_.kind == SensorKind::kStereo) {
    step.result.cause = new_points_.explain_missing_depth(current_, options_.new_points.min_start_points);
  }
  return step.result.cause == LostCause::kNone;
}

/// The camera has been lost for some time, though there is something to see, and does not know where it is:
/// it goes on in a map part of its own, from identity, until a place of both parts is recognised. Not before
/// the map has all that was proposed of the old part, so that nothing here refers to that any more.
bool Tracker::start_part(FrameStep& step) {
  if (!options_.starts_maps) return false;
  const bool something_in_view =
      new_points_.sees_corners(current_.left, options_.loss.min_corners_seen) || sees_structure(step);
  if (loss_.seeing_for(something_in_view, step.frame.t_ns) < options_.loss.new_part_after ||
      !something_in_view || loss_.lost_frames() < options_.loss.new_part_frames) {
    if (monocular_start_) monocular_start_->reset();  // what it followed was seen before
    return false;
  }
  if (step.free_proposal == nullptr || !immature_points_.pending().empty()) {
    if (monocular_start_) monocular_start_->watch(current_, step.frame);
    return false;
  }
  return make_first_keyframe(step) == LostCause::kNone;
}

/// The frame becomes the first keyframe of a map or map part, at identity.
/// @return kNone, or why that cannot be: the result is then as it was, but points that the map does not have
///         are forgotten
LostCause Tracker::make_first_keyframe(FrameStep& step) {
  if (step.free_proposal == nullptr || !immature_points_.room_for_keyframe()) {
    if (monocular_start_) monocular_start_->watch(current_, step.frame);
    return LostCause::kNoKeyframeBuffer;
  }
  if (rig_.kind == SensorKind::kMono) return start_from_motion(step);
  const KeyframeId id = proposer_.next();
  step.shutter = {};  // how the camera moves is not known yet
  immature_points_.clear_points();
  new_points_.forget_seeds();
  if (new_points_.start_first(current_, id, step.shutter, immature_points_) <
      options_.new_points.min_start_points) {
    const LostCause open = judge_structure(step);
    if (open != LostCause::kNone) {
      immature_points_.clear_points();
      // A depth camera beyond its reach sees as much as one camera does.
      if (monocular_start_ && start_from_motion(step) == LostCause::kNone) return LostCause::kNone;
      return open == LostCause::kNoStructure ? open : LostCause::kNoTexture;
    }
    step.result.by_depth = true;
  }
  search_.clear();
  step.result.T_c_ref = SE3();
  proposer_.begin({kNoKeyframe, SE3()}, view_of(step), step, immature_points_);
  new_points_.start_seeds(current_, id, step.shutter);
  hand_over_images(*step.free_proposal);
  step.result.status = TrackStatus::kTracking;
  step.result.cause = LostCause::kNone;
  step.result.reference = id;
  return LostCause::kNone;
}

}  // namespace twofold
