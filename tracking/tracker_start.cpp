// Where tracking starts, stops and starts again: a new map, a loaded one, a new part of it, a place
// recognised.
#include <algorithm>
#include <limits>
#include <utility>

#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kMinStartPoints = 40;

}  // namespace

void Tracker::continue_from(const GraphSnapshot& graph) {
  if (graph.keyframe_count() == 0) return;
  next_.keyframe = static_cast<std::uint32_t>(graph.keyframe_count());
  next_.point = static_cast<std::uint32_t>(graph.point_count());
  unplaced_ = true;
}

const FrameImages& Tracker::ask_where() {
  asked_.images.copy_from(current_);
  asked_.corners.clear();
  return asked_.images;
}

/// Where the loop closer recognised the lost camera.
std::optional<Placement> Tracker::recognised(const GraphSnapshot& graph) {
  const std::optional<Placement> hint = std::exchange(hint_, std::nullopt);
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
  constexpr double kAnyTime = std::numeric_limits<double>::infinity();
  if (search_roughly_from(asked, kAnyTime, step)) return true;
  if (!options_.wide_search.enabled) return false;
  wide_search_.look_at(current_);
  return search_from_view(asked_.images, asked_.corners, asked, kAnyTime, step);
}

/// A keyframe as the map has it: itself, or the one that was left in its place.
std::optional<Placement> Tracker::placement_of(const GraphSnapshot& graph, KeyframeId id) const {
  if (immature_points_.find_pending(id) != nullptr) return Placement{id, SE3()};
  const auto live = graph.contains(id) ? graph.live_replacement(id) : std::nullopt;
  return live ? std::optional(Placement{live->id, live->T_this_live}) : std::nullopt;
}

/// Before the frame is given up: the last good frame or one of the newest keyframes may show what it shows.
bool Tracker::search_widely(FrameStep& step) {
  if (!options_.wide_search.enabled || last_.reference == kNoKeyframe) return false;
  wide_search_.look_at(current_);
  if (!previous_is_keyframe_ &&
      search_from_view(previous_, previous_corners_, last_, options_.coast_for, step))
    return true;
  const KeyframeId part = part_of(step.graph, immature_points_, last_.reference);
  for (std::size_t age = 0; age < recent_views_.size(); ++age) {
    RecentView& view = recent_views_[age];
    const auto placement = placement_of(step.graph, view.id);
    if (!placement || part_of(step.graph, immature_points_, placement->reference) != part) continue;
    if (search_from_view(view.images, view.corners, *placement, options_.coast_for, step)) return true;
  }
  return false;
}

bool Tracker::search_roughly_from(const Placement& placement, double longest, FrameStep& step) {
  return search_from({.placement = placement, .rough = true}, step) == LostCause::kNone &&
         is_within_reach(longest, step);
}

/// Streets repeat themselves, and what looks alike may be the next house but four: the camera must have got
/// there from where it was last, as fast as it moved then, and no other than by what accelerates things that
/// carry cameras.
/// @param longest  time that this is said of [s]: however long a car was out of sight, where it was last it
///                 is not, whatever the street looks like. Where a place was recognised, any time.
bool Tracker::is_within_reach(double longest, const FrameStep& step) const {
  const KeyframeId here = step.result.reference;
  const bool knows_way = rig_.kind != SensorKind::kMono && last_velocity_;  // one camera's unit is no metre
  if (!knows_way ||
      part_of(step.graph, immature_points_, here) != part_of(step.graph, immature_points_, last_.reference))
    return true;
  const double seconds = std::min(longest, 1e-9 * static_cast<double>(step.frame.t_ns - last_t_ns_));
  const SE3 T_here_last = relative_pose(step.graph, immature_points_, here, last_.reference);
  const SE3 T_c_last = step.result.T_c_ref * T_here_last * last_.T_c_ref.inverse();
  const SE3 went_on = SE3::exp(seconds * *last_velocity_);
  const double off = (T_c_last.inverse().translation() - went_on.inverse().translation()).norm();
  return off <= options_.reach_slack + 0.5 * options_.max_acceleration * seconds * seconds;
}

/// After several frames without a pose: where the camera is if it went on as it moved. First of all, because
/// a street may look the same from where the camera was last, too.
bool Tracker::search_ahead(FrameStep& step) {
  const double seconds = 1e-9 * static_cast<double>(step.frame.t_ns - last_t_ns_);
  if (loss_.lost_frames() < 2 || !last_velocity_ || !(seconds <= options_.coast_for)) return false;
  const SE3 motion = SE3::exp(seconds * *last_velocity_);
  if (search_roughly_from({last_.reference, motion * last_.T_c_ref}, options_.coast_for, step)) return true;
  const std::optional<SE3> aligned = align_to_previous(motion, step);
  step.lap(TrackerStage::kAlignment);
  return aligned &&
         search_roughly_from({last_.reference, *aligned * last_.T_c_ref}, options_.coast_for, step);
}

/// What looks alike proposes a pose, the map's points around there decide.
bool Tracker::search_from_view(const FrameImages& images, std::vector<DescribedCorner>& corners,
                               const Placement& view, double longest, FrameStep& step) {
  const auto T_c_view = wide_search_.find(images, corners, options_.search);
  step.lap(TrackerStage::kAlignment);
  if (!T_c_view) return false;
  local_map_.update(step.graph, view.reference, immature_points_, options_.neighbour_keyframes);
  return search_roughly_from({view.reference, *T_c_view * view.T_c_ref}, longest, step);
}

bool Tracker::start_map(FrameStep& step) {
  step.result.cause = make_first_keyframe(step);
  if (step.result.cause == LostCause::kNoTexture && rig_.kind == SensorKind::kStereo) {
    step.result.cause = starter_.explain_missing_depth(current_, kMinStartPoints);
  }
  return step.result.cause == LostCause::kNone;
}

/// The camera has been lost for some time, though there is something to see, and does not know where it is:
/// it goes on in a map part of its own, from identity, until a place of both parts is recognised. Not before
/// the map has all that was proposed of the old part, so that nothing here refers to that any more.
bool Tracker::start_part(FrameStep& step) {
  const bool something_in_view =
      starter_.sees_corners(current_.left, options_.min_corners_seen) || sees_structure(step);
  if (loss_.seeing_for(something_in_view, step.frame.t_ns) < options_.new_part_after || !something_in_view ||
      loss_.lost_frames() < options_.new_part_frames) {
    return false;
  }
  if (step.free_proposal == nullptr || !immature_points_.pending().empty()) return false;
  return make_first_keyframe(step) == LostCause::kNone;
}

/// The frame becomes the first keyframe of a map or map part, at identity.
/// @return kNone, or why that cannot be: the result is then as it was
LostCause Tracker::make_first_keyframe(FrameStep& step) {
  if (step.free_proposal == nullptr || !immature_points_.room_for_keyframe()) {
    return LostCause::kNoKeyframeBuffer;
  }
  if (monocular_start_) return start_from_motion(step);
  const KeyframeId id{next_.keyframe};
  step.shutter = {};  // how the camera moves is not known yet
  immature_points_.clear_points();
  seeds_.clear();
  starter_.clear();
  if (starter_.start(current_, id, step.shutter, immature_points_) < kMinStartPoints) {
    const LostCause open = judge_structure(step);
    if (open != LostCause::kNone) {
      immature_points_.clear_points();  // there were none but these
      return open == LostCause::kNoStructure ? open : LostCause::kNoTexture;
    }
    step.result.by_depth = true;
  }
  matches_.clear();
  motion_.clear();
  last_keyframe_ = {step.result.by_depth ? depth_alignment_->typical_depth() : median_depth(SE3()), 0};
  begin_proposal({kNoKeyframe, SE3()}, step);
  start_seeds(id);
  hand_over_images(*step.free_proposal);
  next_.first_of_part = index(id);
  step.result.status = TrackStatus::kTracking;
  step.result.cause = LostCause::kNone;
  step.result.reference = id;
  step.result.T_c_ref = SE3();
  return LostCause::kNone;
}

void Tracker::give_up_frame(LostCause cause, TrackResult& result) {
  result.status = TrackStatus::kLost;
  result.cause = explain_loss(cause, current_.left, previous_.left, loss_.gap_before());
  result.inliers = 0;
  loss_.lost();
  // previous_ and last_ stay at the last good frame, from where the next one tries again.
}

}  // namespace twofold
