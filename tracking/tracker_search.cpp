// From where the camera should be to where it is: points of the map searched from one start or another, and
// the pose that fits.
#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

void Tracker::collect_local_map(KeyframeId reference, const FrameStep& step) {
  local_map_.update(step.graph, reference, immature_points_, options_.local_map.neighbour_keyframes);
}

/// Points where they should be, where they are, and the pose that fits: once from a good start, a few times
/// from a rough one.
LostCause Tracker::search_from(SearchStart start, FrameStep& step) {
  SE3& T_c_ref = start.placement.T_c_ref;
  step.shutter = start.rough() ? RollingShutter() : shutter_.at(T_c_ref, step);
  LostCause cause = LostCause::kNone;
  const int rounds = start.rough() ? options_.pose.rough.rounds : 1;
  for (int round = 0; cause == LostCause::kNone && round < rounds; ++round) {
    const bool wide = start.rough() ? round + 1 < rounds : step.after_loss();
    const double radius_px = wide ? options_.local_map.lost_radius_px : options_.search.radius_px;
    local_map_search_.run(current_, T_c_ref, radius_px, step, search_);
    cause = pose_estimator_.estimate(start.placement, step, search_);
    T_c_ref = step.result.T_c_ref;
    step.lap(TrackerStage::kMotion);
  }
  if (cause != LostCause::kNone) return cause;
  const bool supported = !start.rough() || pose_estimator_.well_supported(step.result, search_);
  const bool reachable = !(start.rough() || step.after_loss()) || is_within_reach(start.kind, step);
  return supported && reachable ? LostCause::kNone : LostCause::kInconsistentMatches;
}

/// From the dense alignment's pose; where few points are found from there, and it is not where the camera
/// would be had it gone on, from the latter, too. Dense alignment follows what has most gradient, which may
/// be what moves itself, a train or the camera's own shadow: the map's points at rest are then not even
/// searched where they are.
LostCause Tracker::search_from_either(const SearchStart& aligned, FrameStep& step) {
  const LostCause cause = search_from(aligned, step);
  const bool placed = cause == LostCause::kNone;
  const int inliers = placed ? step.result.inliers : 0;
  const bool settled = inliers >= options_.pose.settled_searched_share * step.result.searched;
  if (settled || !leaves_motion(aligned.placement.T_c_ref, step)) return cause;
  const Attempt first = set_aside(step);
  const LostCause other = search_from(
      {.placement = {motion_.reference(), motion_.predicted_pose(step.frame.t_ns, step.after_loss())}}, step);
  const bool better =
      placed ? step.result.inliers > inliers : pose_estimator_.well_supported(step.result, search_);
  if (other == LostCause::kNone && better) return other;
  take_back(first, step);
  return pose_estimator_.estimate(aligned.placement, step,
                                  search_);  // again: what the other start did not find was counted
}

/// What the search from one start came to, while another start is tried.
Attempt Tracker::set_aside(const FrameStep& step) {
  std::swap(search_, tried_);
  return step.attempt();
}

/// Of the attempt set aside last. The local map must be the one that it searched.
void Tracker::take_back(const Attempt& attempt, FrameStep& step) {
  std::swap(search_, tried_);
  step.restore(attempt);
}

/// The pose is further from where the camera would be had it gone on, as the last frame's points show, than
/// points are searched.
bool Tracker::leaves_motion(const SE3& T_c_ref, const FrameStep& step) {
  if (step.after_loss() || !motion_.velocity()) return false;
  const SE3 T_cur_prev = T_c_ref * motion_.T_c_ref().inverse();
  const SE3 T_cur_prev_predicted = motion_.predicted_motion(step.frame.t_ns, false);
  samples_.clear();
  for (const AlignmentPoint& point : last_.points) {
    const Vector3 here = T_cur_prev * point.x, there = T_cur_prev_predicted * point.x;
    if (!in_front_of_camera(here) || !in_front_of_camera(there)) continue;
    samples_.push_back((rig_.camera.project(here) - rig_.camera.project(there)).norm());
  }
  return !samples_.empty() && median(std::span(samples_)) > options_.search.radius_px;
}

}  // namespace twofold
