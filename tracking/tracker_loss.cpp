// Where a lost camera is looked for: where it would be had it gone on, by what the last keyframes saw, and
// where the loop closer recognised it.
#include "tracking/tracker.hpp"

namespace twofold {

/// Where the loop closer recognised the lost camera.
std::optional<Placement> Tracker::recognised(const FrameStep& step) {
  const std::optional<Placement> hint = views_.take_answer();
  if (!hint || !step.after_loss() || !step.graph.contains(hint->reference)) return std::nullopt;
  const auto place = placement_of(step.graph, hint->reference);
  if (!place) return std::nullopt;  // a late answer: the keyframe was culled long ago
  return Placement{place->reference, hint->T_c_ref * place->T_c_ref};
}

/// The camera is about where the frame was taken that was recognised, or, at few frames a second, where it
/// can see what that frame shows.
bool Tracker::search_from_recognised(const Placement& asked, FrameStep& step) {
  collect_local_map(asked.reference, step);
  step.lap(TrackerStage::kCandidates);
  const SearchStart start{.placement = asked, .kind = SearchStart::Kind::kRecognised};
  if (search_from(start, step) == LostCause::kNone) return true;
  if (!views_.can_find()) return false;
  views_.look_at(current_);
  return search_from_view(views_.asked().images, views_.asked().corners, start, step);
}

/// In a map made before: where the camera was said to be.
bool Tracker::search_from_assumed(FrameStep& step) {
  for (int tried = 0; tried < AssumedPlacements::kTriesAFrame; ++tried) {
    const std::optional<Placement> assumed = assumed_.next();
    if (!assumed) return false;
    collect_local_map(assumed->reference, step);
    step.lap(TrackerStage::kCandidates);
    const SearchStart start{.placement = *assumed, .kind = SearchStart::Kind::kRecognised};
    if (search_from(start, step) == LostCause::kNone) return true;
  }
  return false;
}

/// Points and seeds of the part in which the camera was, if it was recognised in another one: how the two lie
/// to each other nobody knows, and none of them can be seen from here.
void Tracker::leave_other_part(const FrameStep& step) {
  const KeyframeId before = motion_.reference();
  if (before == kNoKeyframe || in_same_part(before, step.result.reference, step.graph)) return;
  immature_points_.clear_points();
  new_points_.forget_seeds();
}

bool Tracker::in_same_part(KeyframeId a, KeyframeId b, const GraphSnapshot& graph) const {
  return part_of(graph, immature_points_, a) == part_of(graph, immature_points_, b);
}

/// A keyframe as the map has it: itself, or the one that was left in its place.
std::optional<Placement> Tracker::placement_of(const GraphSnapshot& graph, KeyframeId id) const {
  if (immature_points_.find_pending(id) != nullptr) return Placement{id, SE3()};
  const auto live = graph.contains(id) ? graph.live_replacement(id) : std::nullopt;
  return live ? std::optional(Placement{live->id, live->T_this_live}) : std::nullopt;
}

/// As placement_of, of a keyframe in the part of the map where the last good frame was: how parts lie to each
/// other nobody knows.
std::optional<Placement> Tracker::placement_in_this_part(KeyframeId id, const FrameStep& step) const {
  const std::optional<Placement> placement = placement_of(step.graph, id);
  if (!placement || !in_same_part(placement->reference, motion_.reference(), step.graph)) return std::nullopt;
  return placement;
}

/// Before the frame is given up: the last good frame or one of the newest keyframes may show what it shows.
bool Tracker::search_widely(FrameStep& step) {
  if (!views_.can_find() || motion_.reference() == kNoKeyframe) return false;
  views_.look_at(current_);
  SearchStart start{.placement = motion_.placement(), .kind = SearchStart::Kind::kRough};
  if (!last_.is_keyframe && search_from_view(last_.images, last_.corners, start, step)) return true;
  for (std::size_t age = 0; age < views_.keyframes().size(); ++age) {
    RecentView& view = views_.keyframes()[age];
    const auto placement = placement_in_this_part(view.id, step);
    if (!placement) continue;
    start.placement = *placement;
    if (search_from_view(view.images, view.corners, start, step)) return true;
  }
  return false;
}

/// MotionModel::reaches. One camera's unit is no metre, and where parts of the map lie to each other nobody
/// knows. Only where a place was recognised the camera had all the time since it was seen.
bool Tracker::is_within_reach(SearchStart::Kind kind, const FrameStep& step) const {
  const KeyframeId here = step.result.reference;
  const bool knows_way = rig_.kind != SensorKind::kMono && motion_.velocity();
  if (!knows_way || !in_same_part(here, motion_.reference(), step.graph)) return true;
  const SE3 T_here_last = pose_relative_to(step.graph, immature_points_, here, motion_.reference());
  const SE3 T_c_last = step.result.T_c_ref * T_here_last * motion_.T_c_ref().inverse();
  return motion_.reaches(T_c_last, step.frame.t_ns, kind == SearchStart::Kind::kRecognised);
}

/// After several frames without a pose: where the camera is if it went on as it moved. First of all, because
/// a street may look the same from where the camera was last, too.
bool Tracker::search_ahead(FrameStep& step) {
  const std::optional<SE3> motion = motion_.coasted(step.frame.t_ns);
  if (step.lost_frames < options_.loss.coast_after || !motion) return false;
  SearchStart start{.placement = motion_.placement(), .kind = SearchStart::Kind::kRough};
  start.placement.T_c_ref = *motion * motion_.T_c_ref();
  if (search_from(start, step) == LostCause::kNone) return true;
  const std::optional<SE3> aligned = align_to_previous(*motion, step);
  step.lap(TrackerStage::kAlignment);
  if (!aligned) return false;
  start.placement.T_c_ref = *aligned * motion_.T_c_ref();
  return search_from(start, step) == LostCause::kNone;
}

/// What looks alike proposes a pose, the map's points around there decide.
/// @param view  of the images
bool Tracker::search_from_view(const FrameImages& images, FrameCorners& corners, const SearchStart& view,
                               FrameStep& step) {
  const auto T_c_view = views_.find(images, corners);
  step.lap(TrackerStage::kAlignment);
  if (!T_c_view) return false;
  SearchStart start = view;
  start.placement.T_c_ref = *T_c_view * view.placement.T_c_ref;
  collect_local_map(start.placement.reference, step);
  return search_from(start, step) == LostCause::kNone;
}

void Tracker::give_up_frame(LostCause cause, TrackResult& result) {
  result.status = TrackStatus::kLost;
  result.reference = kNoKeyframe;
  result.cause =
      explain_loss(cause, current_.left, last_.images.left, loss_.gap_before(), options_.loss.signs);
  result.inliers = 0;
  loss_.lost();
  // last_ and motion_ stay at the last good frame, from where the next one tries again.
}

}  // namespace twofold
