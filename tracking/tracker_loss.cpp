// Where a lost camera is looked for: where it would be had it gone on, by what the last keyframes saw, and
// where the loop closer recognised it.
#include <algorithm>
#include <utility>

#include "tracking/tracker.hpp"

namespace twofold {

const FrameImages& Tracker::ask_where() {
  asked_.view.images.copy_from(current_);
  take_corners(asked_.view.corners);
  return asked_.view.images;
}

/// The corners of this frame, once in a frame.
void Tracker::look_widely() {
  if (looked_at_ == frames_) return;
  looked_at_ = frames_;
  wide_search_.look_at(current_);
}

/// Of this frame, if a wider search has found them.
void Tracker::take_corners(FrameCorners& corners) const {
  corners.clear();
  if (looked_at_ == frames_) corners = wide_search_.corners();
}

/// Where the loop closer recognised the lost camera.
std::optional<Placement> Tracker::recognised(const GraphSnapshot& graph) {
  const std::optional<Placement> hint = std::exchange(asked_.answer, std::nullopt);
  if (!hint || loss_.lost_frames() == 0 || !graph.contains(hint->reference)) return std::nullopt;
  const auto place = placement_of(graph, hint->reference);
  if (!place) return std::nullopt;  // a late answer: the keyframe was culled long ago
  return Placement{place->reference, hint->T_c_ref * place->T_c_ref};
}

/// The camera is about where the frame was taken that was recognised, or, at few frames a second, where it
/// can see what that frame shows.
bool Tracker::search_from_recognised(const Placement& asked, FrameStep& step) {
  local_map_.update(step.graph, asked.reference, immature_points_, options_.neighbour_keyframes);
  step.lap(TrackerStage::kCandidates);
  const SearchStart start{.placement = asked, .kind = SearchStart::Kind::kRecognised};
  if (search_from(start, step) == LostCause::kNone) return true;
  if (!searches_widely()) return false;
  look_widely();
  return search_from_view(asked_.view.images, asked_.view.corners, start, step);
}

/// Points and seeds of the part in which the camera was, if it was recognised in another one: how the two lie
/// to each other nobody knows, and none of them can be seen from here.
void Tracker::leave_other_part(const FrameStep& step) {
  const auto part = [&](KeyframeId id) { return part_of(step.graph, immature_points_, id); };
  const KeyframeId before = last_.placement.reference;
  if (before == kNoKeyframe || part(before) == part(step.result.reference)) return;
  immature_points_.clear_points();
  seeds_.clear();
}

/// A keyframe as the map has it: itself, or the one that was left in its place.
std::optional<Placement> Tracker::placement_of(const GraphSnapshot& graph, KeyframeId id) const {
  if (immature_points_.find_pending(id) != nullptr) return Placement{id, SE3()};
  const auto live = graph.contains(id) ? graph.live_replacement(id) : std::nullopt;
  return live ? std::optional(Placement{live->id, live->T_this_live}) : std::nullopt;
}

/// Before the frame is given up: the last good frame or one of the newest keyframes may show what it shows.
bool Tracker::search_widely(FrameStep& step) {
  if (!searches_widely() || last_.placement.reference == kNoKeyframe) return false;
  look_widely();
  SearchStart start{.placement = last_.placement, .kind = SearchStart::Kind::kRough};
  if (!last_.is_keyframe && search_from_view(last_.images, last_.corners, start, step)) return true;
  const KeyframeId part = part_of(step.graph, immature_points_, last_.placement.reference);
  for (std::size_t age = 0; age < recent_views_.size(); ++age) {
    RecentView& view = recent_views_[age];
    const auto placement = placement_of(step.graph, view.id);
    if (!placement || part_of(step.graph, immature_points_, placement->reference) != part) continue;
    start.placement = *placement;
    if (search_from_view(view.images, view.corners, start, step)) return true;
  }
  return false;
}

/// Streets repeat themselves, and what looks alike may be the next house but four: the camera must have got
/// there from where it was last, as fast as it moved then, and no other than by what accelerates things that
/// carry cameras. However long a car was out of sight, it went on for no longer than coast_for: whatever the
/// street looks like, where it was last it is not. Only where a place was recognised it had all that time.
bool Tracker::is_within_reach(SearchStart::Kind kind, const FrameStep& step) const {
  const KeyframeId here = step.result.reference;
  const bool knows_way = rig_.kind != SensorKind::kMono && last_.velocity;  // one camera's unit is no metre
  if (!knows_way || part_of(step.graph, immature_points_, here) !=
                        part_of(step.graph, immature_points_, last_.placement.reference))
    return true;
  double seconds = 1e-9 * static_cast<double>(step.frame.t_ns - last_.t_ns);
  if (kind != SearchStart::Kind::kRecognised) seconds = std::min(options_.coast_for, seconds);
  const SE3 T_here_last = relative_pose(step.graph, immature_points_, here, last_.placement.reference);
  const SE3 T_c_last = step.result.T_c_ref * T_here_last * last_.placement.T_c_ref.inverse();
  const SE3 went_on = SE3::exp(seconds * *last_.velocity);
  const double off = (T_c_last.inverse().translation() - went_on.inverse().translation()).norm();
  return off <= options_.reach_slack + 0.5 * options_.max_acceleration * seconds * seconds;
}

/// After several frames without a pose: where the camera is if it went on as it moved. First of all, because
/// a street may look the same from where the camera was last, too.
bool Tracker::search_ahead(FrameStep& step) {
  const double seconds = 1e-9 * static_cast<double>(step.frame.t_ns - last_.t_ns);
  if (loss_.lost_frames() < 2 || !last_.velocity || !(seconds <= options_.coast_for)) return false;
  const SE3 motion = SE3::exp(seconds * *last_.velocity);
  SearchStart start{.placement = last_.placement, .kind = SearchStart::Kind::kRough};
  start.placement.T_c_ref = motion * last_.placement.T_c_ref;
  if (search_from(start, step) == LostCause::kNone) return true;
  const std::optional<SE3> aligned = align_to_previous(motion, step);
  step.lap(TrackerStage::kAlignment);
  if (!aligned) return false;
  start.placement.T_c_ref = *aligned * last_.placement.T_c_ref;
  return search_from(start, step) == LostCause::kNone;
}

/// What looks alike proposes a pose, the map's points around there decide.
/// @param view  of the images
bool Tracker::search_from_view(const FrameImages& images, FrameCorners& corners, const SearchStart& view,
                               FrameStep& step) {
  const auto T_c_view = wide_search_.find(images, corners, options_.search);
  step.lap(TrackerStage::kAlignment);
  if (!T_c_view) return false;
  SearchStart start = view;
  start.placement.T_c_ref = *T_c_view * view.placement.T_c_ref;
  local_map_.update(step.graph, start.placement.reference, immature_points_, options_.neighbour_keyframes);
  return search_from(start, step) == LostCause::kNone;
}

void Tracker::give_up_frame(LostCause cause, TrackResult& result) {
  result.status = TrackStatus::kLost;
  result.reference = kNoKeyframe;
  result.cause = explain_loss(cause, current_.left, last_.images.left, loss_.gap_before());
  result.inliers = 0;
  loss_.lost();
  // last_ stays at the last good frame, from where the next one tries again.
}

}  // namespace twofold
