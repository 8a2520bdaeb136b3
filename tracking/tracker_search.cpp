// From where the camera should be to where it is: points of the map searched from one start or another, and
// the pose that fits.
#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "geometry/symmetric_solve.hpp"
#include "tracking/tracker.hpp"

namespace twofold {
namespace {

constexpr int kRoundsFromRough = 3;
constexpr int kShutterRounds = 3;

}  // namespace

/// Points where they should be, where they are, and the pose that fits: once from a good start, a few times
/// from a rough one.
LostCause Tracker::search_from(SearchStart start, FrameStep& step) {
  SE3& T_c_ref = start.placement.T_c_ref;
  step.shutter = start.rough() ? RollingShutter() : shutter_.at(T_c_ref, step);
  LostCause cause = LostCause::kNone;
  const int rounds = start.rough() ? kRoundsFromRough : 1;
  for (int round = 0; cause == LostCause::kNone && round < rounds; ++round) {
    const bool wide = start.rough() ? round + 1 < rounds : step.after_loss();
    const double radius_px = wide ? options_.lost_radius_px : options_.search.radius_px;
    local_map_search_.run(current_, T_c_ref, radius_px, step, search_);
    cause = estimate_pose(start.placement, step);
    T_c_ref = step.result.T_c_ref;
    step.lap(TrackerStage::kMotion);
  }
  if (cause != LostCause::kNone) return cause;
  const bool supported = !start.rough() || well_supported(step.result);
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
  const bool settled = inliers >= options_.settled_searched_share * step.result.searched;
  if (settled || !leaves_motion(aligned.placement.T_c_ref, step)) return cause;
  const Attempt first = set_aside(step);
  const LostCause other = search_from(
      {.placement = {motion_.reference(), motion_.predicted_pose(step.frame.t_ns, step.after_loss())}}, step);
  const bool better = placed ? step.result.inliers > inliers : well_supported(step.result);
  if (other == LostCause::kNone && better) return other;
  take_back(first, step);
  return estimate_pose(aligned.placement, step);  // again: what the other start did not find was counted
}

Tracker::Attempt Tracker::set_aside(const FrameStep& step) {
  std::swap(search_, tried_);
  return {step.result, step.shutter};
}

/// Of the attempt set aside last. The local map must be the one that it searched.
void Tracker::take_back(const Attempt& attempt, FrameStep& step) {
  std::swap(search_, tried_);
  step.restore(attempt.result);
  step.shutter = attempt.shutter;
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
    if (std::min(here.z(), there.z()) <= 0) continue;
    samples_.push_back((rig_.camera.project(here) - rig_.camera.project(there)).norm());
  }
  return !samples_.empty() && median(std::span(samples_)) > options_.search.radius_px;
}

/// What was found, as a global shutter would have seen it.
void Tracker::observe_matches(const SE3& T_c_ref, const RollingShutter& shutter) {
  search_.observations.clear();
  for (const SearchOutcome::Match& match : search_.matches) {
    const Vector3& x_ref = local_map_.points()[match.point].x_ref;
    const Eigen::Vector3f z = shutter.at_mid_exposure(rig_, match.found.z, T_c_ref * x_ref).cast<float>();
    search_.observations.push_back({x_ref, z, rig_.information(z, match.found.level)});
  }
}

MotionOnlyOptions Tracker::solver(const FrameStep& step) const {
  MotionOnlyOptions solver = options_.motion;
  solver.max_iterations = step.bounds.motion_iterations;
  return solver;
}

/// Motion-only bundle adjustment  (eq. 3.34), and whether its result can be trusted. Where rows are read one
/// after the other, how they move is known by the result only: a few rounds.
LostCause Tracker::estimate_pose(const Placement& start, FrameStep& step) {
  TrackResult& result = step.result;
  MotionOnlyResult& motion = search_.motion;
  motion.T_c_ref = start.T_c_ref;
  const int rounds = step.shutter.at_rest() ? 1 : kShutterRounds;
  for (int round = 0; round < rounds; ++round) {
    observe_matches(motion.T_c_ref, step.shutter);
    motion = optimise_motion(rig_, search_.observations, motion.T_c_ref, solver(step));
    if (rounds > 1) step.shutter = shutter_.at(motion.T_c_ref, step);
  }
  ask_elders(motion, solver(step));
  result.moving = judge_immature_points();
  elder_vote_.remember(search_.verdict);
  result.inliers = motion.inliers;
  if (result.candidates < options_.min_inliers) return LostCause::kTooFewCandidates;
  if (result.matches < options_.min_inliers) return LostCause::kTooFewMatches;
  if (!motion.determined || motion.inliers < options_.min_inliers ||
      motion.inliers < options_.min_inlier_share * result.matches) {
    return LostCause::kInconsistentMatches;
  }
  result.status = TrackStatus::kTracking;
  result.reference = start.reference;
  result.T_c_ref = motion.T_c_ref;
  result.information = honest_information(step);
  return LostCause::kNone;
}

/// What was found lately must not take the camera along if it moves itself.
void Tracker::ask_elders(MotionOnlyResult& motion, const MotionOnlyOptions& solver) {
  anchors_.clear();
  for (const SearchOutcome::Match& match : search_.matches) {
    anchors_.push_back(local_map_.anchor(local_map_.points()[match.point]));
  }
  search_.verdict = elder_vote_.ask(search_.observations, anchors_, motion, solver);
  if (search_.verdict.by_elders) motion = *search_.verdict.by_elders;
}

/// Which of the tracker's own points are where they should be. A frame that is searched from several starts
/// counts several times: where it is in doubt, points that are not found are given up sooner.
/// @return how many of them move
int Tracker::judge_immature_points() {
  for (const std::uint32_t i : search_.missed) {
    ImmaturePoint* immature = immature_point(local_map_.points()[i]);
    if (immature == nullptr) continue;
    immature->failures = static_cast<std::uint8_t>(std::min(immature->failures + 1, 255));
    immature->agreed = 0;
  }
  int moving = 0;
  for (std::size_t m = 0; m < search_.matches.size(); ++m) {
    ImmaturePoint* immature = immature_point(local_map_.points()[search_.matches[m].point]);
    if (immature == nullptr) continue;
    const bool agrees = search_.observations[m].inlier;
    immature->agreed = static_cast<std::uint8_t>(agrees ? std::min(immature->agreed + 1, 255) : 0);
    immature->moved = static_cast<std::uint8_t>(agrees ? 0 : std::min(immature->moved + 1, 255));
    const bool expelled = search_.verdict.by_elders && !agrees;  // found, but it is something that moves
    immature->failures = expelled ? 255 : 0;
    moving += expelled || immature->moved >= options_.moving_after ? 1 : 0;
  }
  return moving;
}

/// What is known of the pose relative to the reference keyframe, as the residuals say.
Matrix6 Tracker::honest_information(const FrameStep& step) {
  const MotionOnlyResult& motion = search_.motion;
  // A pose that elders alone give is not the one that all points agree on.
  const bool all_agree = !elder_vote_.mistrusts_the_young();
  uncertainty_.update(search_.observations, motion, solver(step), all_agree);
  const auto difference = search_.verdict.difference;
  if (all_agree && difference) uncertainty_.add_split(*difference);
  const Matrix6 covariance = uncertainty_.covariance(motion.information) +
                             shutter_.covariance(motion.information, uncertainty_.by_rows(), step);
  const Matrix6 information = inverse_symmetric(covariance);
  return information.allFinite() ? information : motion.information / uncertainty_.variance_factor();
}

/// Inliers whose depths several keyframes know.
int Tracker::mapped_inliers() const {
  int count = 0;
  for (std::size_t m = 0; m < search_.matches.size(); ++m) {
    const bool mapped = local_map_.points()[search_.matches[m].point].immature < 0;
    count += mapped && search_.observations[m].inlier ? 1 : 0;
  }
  return count;
}

/// A pose from a rough start is believed when the map's points are found where they should be seen from
/// there: from a wrong one some are found as well, but few agree. Few points that were measured from one
/// place only all agree, and are all wrong by their depths' errors.
bool Tracker::well_supported(const TrackResult& result) const {
  return (result.inliers >= options_.rough_min_inliers || mapped_inliers() >= options_.rough_min_mapped) &&
         result.inliers >= options_.rough_inlier_share * result.matches &&
         result.inliers >= options_.rough_searched_share * result.searched;
}

}  // namespace twofold
