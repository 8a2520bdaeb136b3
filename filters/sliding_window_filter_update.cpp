// Linearisation of the sliding window filter: the measurement, process and prior parts of SWF eq. 5-7.
#include <algorithm>
#include <cmath>
#include <span>

#include "base/median.hpp"
#include "camera/measurement.hpp"
#include "estimation/median_chi2.hpp"
#include "estimation/robust_kernel.hpp"
#include "filters/sliding_window_filter.hpp"
#include "geometry/cbh.hpp"

namespace twofold {
namespace {

constexpr double kUnknownLandmark = 1e-6;  // [1/m^2]: keeps the system regular, and moves nothing

}  // namespace

bool SlidingWindowFilter::pose_is_linearised_at_prior(int pose) const {
  return pose == 0 && first_estimates() && !oldest_fixed_ &&
         !prior_.information.bottomRightCorner<6, 6>().isZero(0);
}

const SE3& SlidingWindowFilter::pose_lin(int pose) const {
  return pose_is_linearised_at_prior(pose) ? prior_.T_lin : poses_[static_cast<std::size_t>(pose)].T_c_l;
}

const Vector3& SlidingWindowFilter::landmark_lin(int landmark) const {
  const auto l = static_cast<std::size_t>(landmark);
  return first_estimates() && landmark < prior_.landmark_count() ? prior_.landmarks_lin[l] : points_[l];
}

SlidingWindowFilter::WhitenedError SlidingWindowFilter::whitened_error(int pose,
                                                                       const Observation& observation) const {
  const Vector3 x_c =
      poses_[static_cast<std::size_t>(pose)].T_c_l * points_[static_cast<std::size_t>(observation.landmark)];
  if (!in_front_of_camera(x_c)) return {};
  const Vector3 r = observation.pixel - rig_.project(x_c);
  if (has_right(r)) return {r.dot(observation.information * r), 3};
  return {r.head<2>().dot(observation.information.topLeftCorner<2, 2>() * r.head<2>()), 2};
}

SlidingWindowFilter::ObservationTerm SlidingWindowFilter::linearise(int pose,
                                                                    const Observation& observation) const {
  ObservationTerm term;
  const Vector3 x_c =
      poses_[static_cast<std::size_t>(pose)].T_c_l * points_[static_cast<std::size_t>(observation.landmark)];
  const SE3& T_lin = pose_lin(pose);
  const Vector3 x_lin = T_lin * landmark_lin(observation.landmark);
  if (!in_front_of_camera(x_c) || !in_front_of_camera(x_lin)) return term;

  term.valid = true;
  term.r = observation.pixel - rig_.project(x_c);
  Matrix3 J = rig_.project_jacobian(x_lin);
  term.information = observation.information;
  const int rows = has_right(term.r) ? 3 : 2;
  if (rows == 2) {
    term.r.z() = 0;
    J.row(2).setZero();
    term.information.row(2).setZero();
    term.information.col(2).setZero();
  }
  const double chi2 = term.r.dot(term.information * term.r);
  term.information *= HuberKernel{huber(rows)}.weight(chi2);
  if (pose == 0 && oldest_fixed_) {
    term.J_pose.setZero();
  } else {
    term.J_pose << J, -J * hat(x_lin);
  }
  term.J_landmark.noalias() = J * T_lin.rotation();
  return term;
}

MotionError SlidingWindowFilter::linearise_motion(int pose) const {
  const Pose& cur = poses_[static_cast<std::size_t>(pose)];
  const Pose& prev = poses_[static_cast<std::size_t>(pose) - 1];
  MotionError error = motion_error(*cur.motion, prev.T_c_l, cur.T_c_l);
  if (pose_is_linearised_at_prior(pose - 1)) {
    const MotionError at_first = motion_error(*cur.motion, pose_lin(0), cur.T_c_l);
    error.J_prev = at_first.J_prev;
    error.J_cur = at_first.J_cur;
  }
  if (pose == 1 && oldest_fixed_) error.J_prev.setZero();
  return error;
}

void SlidingWindowFilter::build_equations() {
  FilterEquations& eq = equations_;
  eq.reset(pose_count(), landmark_count());
  eq.prior_landmarks = prior_.landmark_count();
  eq.prior = prior_.information;
  if (!poses_.empty()) add_prior();
  for (int j = 0; j < pose_count(); ++j) {
    add_measurements(j);
    if (j > 0 && poses_[static_cast<std::size_t>(j)].motion) add_motion(j);
  }
  // A landmark with neither prior nor a valid measurement (behind every camera) stays where it is.
  for (std::size_t l = static_cast<std::size_t>(eq.prior_landmarks); l < eq.V.size(); ++l) {
    if (eq.V[l].isZero(0)) eq.V[l] = kUnknownLandmark * Matrix3::Identity();
  }
}

/// L^T Pi L and its right-hand side.
void SlidingWindowFilter::add_prior() {
  FilterEquations& eq = equations_;
  const VectorX d = prior_.difference(points_, poses_.front().T_c_l, shift_);
  VectorX g = prior_.vector - prior_.information * d;
  if (!first_estimates()) {
    const Matrix6 J = cbh_jacobian<SE3>(d.tail<6>(), CbhOrder::kExact);
    g.tail<6>() = (J.transpose() * g.tail<6>()).eval();
    eq.prior.rightCols<6>() = (eq.prior.rightCols<6>() * J).eval();
    eq.prior.bottomRows<6>() = (J.transpose() * eq.prior.bottomRows<6>()).eval();
  }
  for (int l = 0; l < eq.prior_landmarks; ++l)
    eq.g_landmarks[static_cast<std::size_t>(l)] = g.segment<3>(3 * l);
  eq.g_poses.front() = g.tail<6>();
  if (oldest_fixed_) {
    eq.U.front().setIdentity();
    eq.g_poses.front().setZero();
  }
}

/// H^T R^-1 H of the measurements of one pose.
void SlidingWindowFilter::add_measurements(int pose) {
  FilterEquations& eq = equations_;
  const auto p = static_cast<std::size_t>(pose);
  for (const Observation& observation : poses_[p].observations) {
    const ObservationTerm term = linearise(pose, observation);
    if (!term.valid) continue;
    const auto l = static_cast<std::size_t>(observation.landmark);
    const Matrix3 WJ_l = term.information * term.J_landmark;
    const Vector3 Wr = term.information * term.r;
    eq.V[l].noalias() += term.J_landmark.transpose() * WJ_l;
    eq.g_landmarks[l].noalias() += term.J_landmark.transpose() * Wr;
    if (pose == 0 && oldest_fixed_) continue;
    eq.U[p].noalias() += term.J_pose.transpose() * (term.information * term.J_pose);
    eq.g_poses[p].noalias() += term.J_pose.transpose() * Wr;
    eq.couplings.push_back({pose, observation.landmark, term.J_pose.transpose() * WJ_l});
  }
}

/// D^T Q^-1 D of the motion from the pose before.
void SlidingWindowFilter::add_motion(int pose) {
  FilterEquations& eq = equations_;
  const auto p = static_cast<std::size_t>(pose);
  const MotionError error = linearise_motion(pose);
  const Matrix6 Q_inv = poses_[p].motion->information();
  eq.has_motion = true;
  eq.U[p - 1] += error.J_prev.transpose() * Q_inv * error.J_prev;
  eq.U[p] += error.J_cur.transpose() * Q_inv * error.J_cur;
  eq.E[p - 1] += error.J_prev.transpose() * Q_inv * error.J_cur;
  eq.g_poses[p - 1] -= error.J_prev.transpose() * Q_inv * error.e;
  eq.g_poses[p] -= error.J_cur.transpose() * Q_inv * error.e;
}

double SlidingWindowFilter::cost() const {
  double sum = 0;
  if (!poses_.empty()) {
    const VectorX d = prior_.difference(points_, poses_.front().T_c_l, shift_);
    const VectorX half = 0.5 * (prior_.information * d) - prior_.vector;
    sum += d.dot(half);
  }
  for (int j = 0; j < pose_count(); ++j) {
    const Pose& pose = poses_[static_cast<std::size_t>(j)];
    for (const Observation& observation : pose.observations) {
      const auto [chi2, rows] = whitened_error(j, observation);
      if (rows > 0) sum += 0.5 * HuberKernel{huber(rows)}.rho(chi2);
    }
    if (j == 0 || !pose.motion) continue;
    const Vector6 e = motion_error(*pose.motion, poses_[static_cast<std::size_t>(j) - 1].T_c_l, pose.T_c_l).e;
    sum += 0.5 * e.dot(pose.motion->information() * e);
  }
  return sum;
}

void SlidingWindowFilter::update_threshold() {
  std::vector<WhitenedError> errors;
  std::vector<double> variances;  // of one component, as each error says if it is of the middle
  for (int j = 0; j < pose_count(); ++j) {
    for (const Observation& observation : poses_[static_cast<std::size_t>(j)].observations) {
      const WhitenedError error = whitened_error(j, observation);
      if (error.rows == 0) continue;
      errors.push_back(error);
      variances.push_back(error.chi2 / median_chi2(error.rows));
    }
  }
  summary_.outliers = 0;
  summary_.inlier_sigma = 0;
  if (errors.empty()) return;
  double limit2 = huber_ * huber_ / 3.0;  // a component
  if (huber_ == 0) {  // no threshold yet: three times the robust spread given by the median
    const double least = options_.min_inlier_sigma * options_.min_inlier_sigma;
    limit2 = 9.0 * std::max(median(std::span(variances)), least);
  }
  double sum = 0;
  int inliers = 0, measured = 0;
  for (const auto [chi2, rows] : errors) {
    if (chi2 > limit2 * rows) continue;
    sum += chi2;
    ++inliers;
    measured += rows;
  }
  summary_.outliers = static_cast<int>(errors.size()) - inliers;
  // Free landmarks and poses without process model take up as many residuals as they have unknowns.
  int unknowns = 3 * (landmark_count() - prior_.landmark_count());
  for (int j = oldest_fixed_ ? 1 : 0; j < pose_count(); ++j) {
    if (!poses_[static_cast<std::size_t>(j)].motion) unknowns += 6;
  }
  const int dof = measured - unknowns;
  summary_.inlier_sigma = std::sqrt(sum / std::max(1, dof));
  if (options_.robust) {
    // Too few surplus residuals to estimate a spread from: the stated variances stand.
    const double sigma =
        dof >= options_.min_spread_dof ? std::max(summary_.inlier_sigma, options_.min_inlier_sigma) : 1.0;
    huber_ = options_.huber_sigmas * std::sqrt(3.0) * sigma;
  }
}

}  // namespace twofold
