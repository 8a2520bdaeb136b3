#include "filters/sliding_window_filter.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "base/check.hpp"
#include "base/option_check.hpp"
#include "estimation/levenberg_marquardt.hpp"

namespace twofold {

std::string SlidingWindowOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("window", window, 0)
      .above("huber_sigmas", huber_sigmas, 0)
      .above("min_inlier_sigma", min_inlier_sigma, 0)
      .at_least("min_spread_dof", min_spread_dof, 1)
      .at_least("max_iterations", max_iterations, 0)
      .at_least("stop_decrement", stop_decrement, 0)
      .at_least("initial_damping", initial_damping, 0)
      .above("min_disparity_px", min_disparity_px, 0)
      .reason();
}

SlidingWindowFilter::SlidingWindowFilter(const Rig& rig, const SlidingWindowOptions& options)
    : rig_(rig), options_(options) {
  const std::string reason = options.invalid_reason();
  if (!reason.empty()) throw std::runtime_error("sliding window filter: " + reason);
}

void SlidingWindowFilter::set_first_pose(const SE3& T_c_w, const std::optional<Matrix6>& information) {
  TWOFOLD_CHECK(next_frame_ == 0, "set_first_pose before the first step");
  first_T_c_w_ = T_c_w;
  prior_.T_lin = T_c_w;
  oldest_fixed_ = !information.has_value();
  if (information) prior_.information = *information;
}

FilterSummary SlidingWindowFilter::step(const FilterFrame& frame) {
  add(frame);
  return optimise();
}

void SlidingWindowFilter::add(const FilterFrame& frame) {
  Pose pose;
  pose.frame = next_frame_++;
  if (poses_.empty()) {
    pose.T_c_l = first_T_c_w_;
  } else if (frame.motion) {
    pose.T_c_l = compound(*frame.motion, poses_.back().T_c_l);
    pose.motion = frame.motion;
  } else {
    pose.T_c_l = frame.T_c_w_start ? *frame.T_c_w_start * T_w_l_ : poses_.back().T_c_l;
  }
  const bool first = poses_.empty();
  factor_serves_ = false;
  poses_.push_back(std::move(pose));
  summary_.landmarks_marginalised = 0;
  // Removal comes first: the process model must be linearised at its own prediction.
  if (options_.window > 0 && pose_count() > options_.window) remove_oldest(frame);
  if (options_.motion_only_start && !first) fit_newest_pose(frame);
  add_observations(frame);
}

void SlidingWindowFilter::add_observations(const FilterFrame& frame) {
  Pose& pose = poses_.back();
  const SE3 T_l_c = pose.T_c_l.inverse();
  for (const LandmarkObservation& observation : frame.observations) {
    auto found = index_.find(observation.landmark);
    if (found == index_.end()) {
      const double disparity = observation.pixel.x() - observation.pixel.z();
      if (!(disparity >= options_.min_disparity_px)) continue;  // also when u_r is NaN
      found = index_.emplace(observation.landmark, landmark_count()).first;
      landmarks_.push_back({});
      ids_.push_back(observation.landmark);
      points_.push_back(T_l_c * rig_.unproject(observation.pixel));
    }
    pose.observations.push_back({found->second, observation.pixel, observation.information});
    ++landmarks_[static_cast<std::size_t>(found->second)].observations;
  }
}

std::optional<Vector3> SlidingWindowFilter::find_landmark(std::int64_t id) const {
  const auto found = index_.find(id);
  if (found == index_.end()) return std::nullopt;
  return landmark(found->second);
}

bool SlidingWindowFilter::set_measurement(int pose, std::int64_t id, const StereoPixel& z) {
  const auto found = index_.find(id);
  if (found == index_.end()) return false;
  for (Observation& o : poses_[static_cast<std::size_t>(pose)].observations) {
    if (o.landmark != found->second) continue;
    o.pixel = z;
    return true;
  }
  return false;
}

FilterSummary SlidingWindowFilter::optimise() {
  return optimise(options_.max_iterations);
}

/// Gauss-Newton; damped, as Levenberg and Marquardt do, after steps that failed.
FilterSummary SlidingWindowFilter::optimise(int max_iterations) {
  summary_.iterations = summary_.factorisations = 0;
  summary_.converged = false;
  huber_ = 0;
  update_threshold();
  build_equations();
  double damping = options_.initial_damping;
  double current = cost();
  double last_decrement = 0;
  // Between two calls in a frame the state keeps its structure, so that the factor may serve again.
  bool reuse_factor = options_.reuse_factor && factor_serves_;
  while (summary_.iterations < max_iterations) {
    ++summary_.iterations;
    if (!reuse_factor && !factorise(damping)) {
      damping = raised_damping(damping, 1e-6);
      continue;
    }
    factor_.solve(equations_.g_poses, equations_.g_landmarks, step_);
    const double decrement = this->decrement();
    const Estimate before = estimate();
    apply(step_);
    summary_.converged = decrement <= options_.stop_decrement;
    if (summary_.converged) break;
    if (!(cost() <= current + allowed_rise(current, reuse_factor ? 0.0 : decrement))) {
      set_estimate(before);
      if (!reuse_factor) damping = raised_damping(damping, 1e-3);
      reuse_factor = false;
      continue;
    }
    damping *= 0.1;
    if (summary_.iterations <= 5) update_threshold();
    build_equations();
    current = cost();
    // Not after the first step, which is the longest: its factor would serve the second one badly.
    const bool contracts = summary_.iterations > 1 && decrement < 0.05 * last_decrement;
    reuse_factor = options_.reuse_factor && contracts;
    last_decrement = decrement;
  }
  summary_.cost = cost();
  move_frame();
  summary_.poses = pose_count();
  summary_.landmarks = landmark_count();
  return summary_;
}

bool SlidingWindowFilter::factorise(double damping) {
  ++summary_.factorisations;
  factor_serves_ = factor_.factorise(equations_, damping);
  return factor_serves_;
}

/// First-estimate derivatives lead to a point that is not exactly the minimum of the cost, so that close to
/// it the cost may rise a little; a rise by one is within the noise of a single residual.
/// @param promised  expected fall of the cost; 0 of an old factor's step: what that promises is no measure
double SlidingWindowFilter::allowed_rise(double cost, double promised) const {
  const double rounding = 1e-9 * (1 + std::abs(cost));
  return first_estimates() ? rounding + (1.0 + promised) : rounding;
}

double SlidingWindowFilter::decrement() const {
  double sum = 0;
  for (std::size_t j = 0; j < step_.poses.size(); ++j) sum += equations_.g_poses[j].dot(step_.poses[j]);
  for (std::size_t l = 0; l < step_.landmarks.size(); ++l) {
    sum += equations_.g_landmarks[l].dot(step_.landmarks[l]);
  }
  return sum;
}

SlidingWindowFilter::Estimate SlidingWindowFilter::estimate() const {
  Estimate estimate{{}, points_, shift_};
  for (const Pose& pose : poses_) estimate.T_c_l.push_back(pose.T_c_l);
  return estimate;
}

void SlidingWindowFilter::set_estimate(const Estimate& estimate) {
  for (std::size_t j = 0; j < poses_.size(); ++j) poses_[j].T_c_l = estimate.T_c_l[j];
  points_ = estimate.points;
  shift_ = estimate.shift;
}

void SlidingWindowFilter::apply(const FilterStep& step) {
  // What the prior's parameters move together is a motion of frame l; the rest happens in l.
  const Vector6 xi = first_estimates() && !oldest_fixed_ ? prior_.frame_twist(step) : Vector6::Zero();
  shift_ += xi;
  const SE3 T_lin_inverse = prior_.T_lin.inverse();
  for (int j = oldest_fixed_ ? 1 : 0; j < pose_count(); ++j) {
    const auto p = static_cast<std::size_t>(j);
    const Vector6 own = step.poses[p] + (pose_lin(j) * T_lin_inverse).adjoint() * xi;
    poses_[p].T_c_l = SE3::exp(own) * poses_[p].T_c_l;
  }
  const Matrix3 R_l_c = T_lin_inverse.rotation();
  std::vector<Vector3> change_l;
  for (int l = 0; l < landmark_count(); ++l) {
    const Vector3 x_c = prior_.T_lin * landmark_lin(l);
    change_l.push_back(step.landmarks[static_cast<std::size_t>(l)] -
                       R_l_c * (xi.head<3>() + xi.tail<3>().cross(x_c)));
  }
  // A badly started or mismatched landmark can overshoot through infinity to behind the cameras, from where
  // no measurement brings it back: its step is cut so that its depth falls to no less than half in any view.
  std::vector<double> share(points_.size(), 1.0);
  for (const Pose& pose : poses_) {
    const Vector3 axis_l = pose.T_c_l.rotation().row(2).transpose();
    for (const Observation& o : pose.observations) {
      const auto l = static_cast<std::size_t>(o.landmark);
      const double depth = axis_l.dot(points_[l]) + pose.T_c_l.translation().z();
      const double change = axis_l.dot(change_l[l]);
      if (depth > 0 && change < -0.5 * depth) share[l] = std::min(share[l], -0.5 * depth / change);
    }
  }
  for (std::size_t l = 0; l < points_.size(); ++l) points_[l] += share[l] * change_l[l];
}

void SlidingWindowFilter::move_frame() {
  if (shift_.isZero(0)) return;
  T_w_l_ = T_w_l_ * prior_.move_frame(shift_);
  shift_.setZero();
}

std::optional<FilterCovariances> SlidingWindowFilter::covariances() {
  build_equations();
  factor_serves_ = factor_.factorise(equations_, 0.0);
  if (!factor_serves_) return std::nullopt;
  FilterCovariances result = factor_.covariances();
  const Matrix3 R_w_l = T_w_l_.rotation();
  for (Matrix3& C : result.landmarks) C = R_w_l * C * R_w_l.transpose();
  if (oldest_fixed_ && !result.poses.empty()) result.poses.front().setZero();
  return result;
}

}  // namespace twofold
