#include "tracking/pose/pose_estimator.hpp"

#include <algorithm>

#include "geometry/inverse_depth.hpp"
#include "geometry/symmetric_solve.hpp"

namespace twofold {

PoseEstimator::PoseEstimator(const Rig& rig, const TrackerOptions& options, const LocalMap& local_map,
                             const ShutterModel& shutter, ImmaturePoints& immature_points)
    : rig_(rig),
      options_(options),
      local_map_(local_map),
      shutter_(shutter),
      immature_points_(immature_points),
      elder_vote_(rig, static_cast<std::size_t>(options.local_map.max_searches), options.pose.elders),
      uncertainty_(rig, options.pose.uncertainty) {
  anchors_.reserve(static_cast<std::size_t>(options.local_map.max_searches));
}

/// Where rows are read one after the other, how they move is known by the result only: a few rounds.
LostCause PoseEstimator::estimate(const Placement& start, FrameStep& step, SearchOutcome& found) {
  TrackResult& result = step.result;
  MotionOnlyResult& motion = found.motion;
  motion.T_c_ref = start.T_c_ref;
  const int rounds = step.shutter.at_rest() ? 1 : options_.pose.shutter_rounds;
  for (int round = 0; round < rounds; ++round) {
    const SE3 T_before = motion.T_c_ref;
    observe(T_before, step.shutter, found);
    motion = optimise_motion(rig_, found.observations, T_before, solver(step));
    if (rounds == 1) break;
    step.shutter = shutter_.at(motion.T_c_ref, step);
    const Vector6 moved = (motion.T_c_ref * T_before.inverse()).log();
    const double settled = options_.pose.shutter_settled;
    if (moved.dot(motion.information * moved) < settled * settled) break;
  }
  ask_elders(solver(step), found);
  result.moving = judge_immature_points(found);
  elder_vote_.remember(found.verdict);
  result.inliers = motion.inliers;
  if (result.candidates < options_.pose.min_inliers) return LostCause::kTooFewCandidates;
  if (result.matches < options_.pose.min_inliers) return LostCause::kTooFewMatches;
  if (!motion.determined || motion.inliers < options_.pose.min_inliers ||
      motion.inliers < options_.pose.min_inlier_share * result.matches) {
    return LostCause::kInconsistentMatches;
  }
  result.status = TrackStatus::kTracking;
  result.reference = start.reference;
  result.T_c_ref = motion.T_c_ref;
  result.information = honest_information(step, found);
  return LostCause::kNone;
}

/// What was found lately must not take the camera along if it moves itself.
void PoseEstimator::ask_elders(const MotionOnlyOptions& solver, SearchOutcome& found) {
  anchors_.clear();
  for (const SearchOutcome::Match& match : found.matches) {
    anchors_.push_back(local_map_.anchor(local_map_.points()[match.point]));
  }
  found.verdict = elder_vote_.ask(found.observations, anchors_, found.motion, solver);
  if (found.verdict.by_elders) found.motion = *found.verdict.by_elders;
}

/// Which of the immature points are where they should be.
/// @return how many of them move
int PoseEstimator::judge_immature_points(const SearchOutcome& found) {
  for (const std::uint32_t i : found.missed) {
    ImmaturePoint* immature = immature_points_.at(local_map_.points()[i].immature);
    if (immature == nullptr) continue;
    immature->failures = static_cast<std::uint8_t>(std::min(immature->failures + 1, 255));
    immature->agreed = 0;
  }
  int moving = 0;
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    ImmaturePoint* immature = immature_points_.at(local_map_.points()[found.matches[m].point].immature);
    if (immature == nullptr) continue;
    const bool agrees = found.observations[m].inlier;
    immature->agreed = static_cast<std::uint8_t>(agrees ? std::min(immature->agreed + 1, 255) : 0);
    immature->moved = static_cast<std::uint8_t>(agrees ? 0 : std::min(immature->moved + 1, 255));
    const bool expelled = found.verdict.by_elders && !agrees;  // found, but it is something that moves
    immature->failures = expelled ? 255 : 0;
    moving += expelled || immature->moved >= options_.immature.moving_after ? 1 : 0;
  }
  return moving;
}

/// Share of the information on where a ray is seen that is left when its depth is taken for unknown.
float PoseEstimator::certainty(const TrackedPoint& point, const SE3& T_c_ref) const {
  const Vector3 x_c = T_c_ref * point.x_ref;
  if (!in_front_of_camera(x_c)) return 0;
  // With its inverse depth q the point moves along its ray: d x_c / d q = (anchor - x_c) / q.
  const Vector3 along = (T_c_ref * local_map_.T_ref_a(point).translation() - x_c) / point.psi.z();
  const double by_depth = point.ray_sigma * (rig_.camera.project_jacobian(x_c) * along).norm();
  const double sigma = rig_.sigma_px(point.appearance->level);
  return static_cast<float>(sigma * sigma / (sigma * sigma + by_depth * by_depth));
}

/// What was found, as a global shutter would have seen it.
void PoseEstimator::observe(const SE3& T_c_ref, const RollingShutter& shutter, SearchOutcome& found) const {
  found.observations.clear();
  for (const SearchOutcome::Match& match : found.matches) {
    const TrackedPoint& point = local_map_.points()[match.point];
    const Vector3& x_ref = point.x_ref;
    const StereoPixelF z = shutter.at_mid_exposure(rig_, match.found.pixel, T_c_ref * x_ref).cast<float>();
    found.observations.push_back(observe_point(rig_, x_ref, z, match.found.level));
    if (point.ray_sigma > 0) found.observations.back().information *= certainty(point, T_c_ref);
  }
}

/// What is known of the pose relative to the reference keyframe, as the residuals say.
Matrix6 PoseEstimator::honest_information(const FrameStep& step, const SearchOutcome& found) {
  const MotionOnlyResult& motion = found.motion;
  // A pose that elders alone give is not the one that all points agree on.
  const bool all_agree = !elder_vote_.mistrusts_the_young();
  uncertainty_.update(found.observations, motion, solver(step), all_agree);
  const auto difference = found.verdict.difference;
  if (all_agree && difference) uncertainty_.add_split(*difference);
  const Matrix6 covariance = uncertainty_.covariance(motion.information) +
                             shutter_.covariance(motion.information, uncertainty_.by_rows(), step);
  const Matrix6 information = inverse_symmetric(covariance);
  return information.allFinite() ? information : motion.information / uncertainty_.variance_factor();
}

MotionOnlyOptions PoseEstimator::solver(const FrameStep& step) const {
  MotionOnlyOptions solver = options_.pose.motion;
  solver.max_iterations = step.bounds.motion_iterations;
  return solver;
}

/// Inliers whose depths several keyframes know.
int PoseEstimator::mapped_inliers(const SearchOutcome& found) const {
  int count = 0;
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    const bool mapped = local_map_.points()[found.matches[m].point].immature < 0;
    count += mapped && found.observations[m].inlier ? 1 : 0;
  }
  return count;
}

int PoseEstimator::inliers_with_depth(const SearchOutcome& found) const {
  int count = 0;
  for (std::size_t m = 0; m < found.matches.size(); ++m)
    count += found.observations[m].inlier && local_map_.points()[found.matches[m].point].ray_sigma == 0;
  return count;
}

bool PoseEstimator::well_supported(const TrackResult& result, const SearchOutcome& found) const {
  return (result.inliers >= options_.pose.rough.min_inliers ||
          mapped_inliers(found) >= options_.pose.rough.min_mapped) &&
         result.inliers >= options_.pose.rough.inlier_share * result.matches &&
         result.inliers >= options_.pose.rough.searched_share * result.searched;
}

}  // namespace twofold
