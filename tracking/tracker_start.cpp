// Where tracking starts, stops and starts again: a new map, a loaded one, a new part of it, a place
// recognised.
#include <utility>

#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kMinStartPoints = 40;

}  // namespace

void Tracker::continue_from(const GraphSnapshot& graph) {
  if (graph.keyframe_count() == 0) return;
  next_keyframe_ = static_cast<std::uint32_t>(graph.keyframe_count());
  next_point_ = static_cast<std::uint32_t>(graph.point_count());
  unplaced_ = true;
}

void Tracker::relocalise(KeyframeId id, const SE3& T_c_k) {
  hint_keyframe_ = id;
  hint_T_c_k_ = T_c_k;
}

/// Moves to where the loop closer recognised the camera, if it is lost.
bool Tracker::take_hint(const GraphSnapshot& graph) {
  const KeyframeId id = std::exchange(hint_keyframe_, kNoKeyframe);
  if (id == kNoKeyframe || lost_frames_ == 0 || !graph.contains(id)) return false;
  const auto live_replacement = graph.live_replacement(id);
  if (!live_replacement) return false;  // a late answer: the keyframe was culled long ago
  T_prev_ref_ = hint_T_c_k_ * live_replacement->T_this_live;
  reference_ = live_replacement->id;
  local_map_stale_ = true;
  return true;
}

bool Tracker::start_map(const Frame& frame, KeyframeProposal* proposal, TrackResult& result) {
  result.status = TrackStatus::kInitialising;
  result.cause = LostCause::kNoKeyframeBuffer;
  if (proposal == nullptr || !immature_points_.room_for_keyframe()) return false;
  const KeyframeId id{next_keyframe_};
  starter_.clear();
  if (starter_.start(current_, id, immature_points_) < kMinStartPoints) {
    immature_points_.clear_points();  // there were none but these
    result.cause = LostCause::kNoTexture;
    return false;
  }
  proposal->clear();
  proposal->id = id;
  proposal->frame_index = frame.index;
  proposal->t_ns = frame.t_ns;
  matches_.clear();
  motion_.clear();
  proposal->median_depth = keyframe_depth_ = median_depth(SE3());
  hand_over_images(*proposal);
  immature_points_.add_pending({id, kNoKeyframe, SE3()});
  first_of_part_ = next_keyframe_++;
  reference_ = id;
  local_map_stale_ = true;
  regions_at_keyframe_ = 0;
  result.status = TrackStatus::kTracking;
  result.cause = LostCause::kNone;
  result.reference = id;
  result.proposed = true;
  return true;
}

/// Lost for some time, though there is something to see.
bool Tracker::new_part_due(std::int64_t t_ns) {
  if (!starter_.sees_corners(current_, options_.min_corners_seen)) {
    seeing_since_ns_ = 0;
    return false;
  }
  if (seeing_since_ns_ == 0) seeing_since_ns_ = t_ns;
  return static_cast<double>(t_ns - seeing_since_ns_) >= options_.new_part_after * 1e9;
}

/// The camera does not know where it is: it goes on in a map part of its own, from identity, until a place
/// of both parts is recognised. Not before the map has all that was proposed of the old part, so that nothing
/// here refers to that any more.
bool Tracker::start_part(const Frame& frame, KeyframeProposal* proposal, TrackResult& result) {
  if (proposal == nullptr || !immature_points_.pending().empty()) return false;
  immature_points_.clear_points();
  TrackResult started = result;
  if (!start_map(frame, proposal, started)) return false;
  unplaced_ = false;
  result = started;
  result.T_c_ref = SE3();
  return true;
}

void Tracker::give_up_frame(LostCause cause, TrackResult& result) {
  result.status = TrackStatus::kLost;
  result.cause = explain_loss(cause, current_.left, previous_.left, gap_before_loss_);
  result.inliers = 0;
  ++lost_frames_;
  // previous_ and T_prev_ref_ stay at the last good frame, from where the next one tries again.
}

}  // namespace twofold
