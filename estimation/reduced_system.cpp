#include "estimation/reduced_system.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "estimation/pose_constraint.hpp"

namespace twofold {

WindowState ReducedSystem::start(const WindowProblem& problem) {
  layout_.build(problem, cholesky_);
  WindowState state;
  for (const auto& pose : problem.poses) state.poses.push_back(pose.T_k_w);
  for (const auto& track : layout_.tracks()) state.psi.push_back(problem.points[track.point].psi);
  relative_poses(layout_, state.poses, state.relative);
  return state;
}

void ReducedSystem::build(const WindowProblem& problem, const WindowSolverOptions& options,
                          const WindowState& state, double lambda) {
  cholesky_.set_zero();
  gradient_.assign(cholesky_.size(), Vector6::Zero());
  diagonal_.assign(cholesky_.size(), Vector6::Zero());
  elimination_.eliminate(layout_, ObservationModel(problem.rig), HuberKernel{options.huber_px},
                         state.relative, state.psi, lambda, cholesky_, gradient_, diagonal_);
  const HuberKernel kernel{options.constraint_huber};
  for (const auto& constraint : problem.constraints) add_constraint(constraint, kernel, state.poses);

  // A direction in which nothing pulls at a pose is held by a share of what pulls at the average pose.
  Vector6 mean = Vector6::Zero();
  for (const Vector6& d : diagonal_) mean += d / static_cast<double>(diagonal_.size());
  for (int p = 0; p < cholesky_.size(); ++p) {
    diagonal_[p] = diagonal_[p].cwiseMax(1e-6 * mean);
    cholesky_.block(cholesky_.diagonal_index(p)).diagonal() += lambda * diagonal_[p];
  }
}

void ReducedSystem::add_constraint(const WindowProblem::PoseConstraint& c, const HuberKernel& kernel,
                                   const std::vector<SE3>& poses) {
  const int i = layout_.position(c.i), j = layout_.position(c.j);
  if (i < 0 && j < 0) return;
  const auto terms = linearise_pose_constraint(c.T_j_i, poses[c.i], poses[c.j]);
  const Vector6 information_v = c.information * terms.v;
  const double weight = kernel.weight(terms.v.dot(information_v));
  Matrix6 WJ_i, WJ_j, H;
  WJ_i.noalias() = c.information * terms.J_i;
  WJ_j.noalias() = c.information * terms.J_j;
  const auto add_diagonal = [&](int position, const Matrix6& J, const Matrix6& WJ) {
    if (position < 0) return;
    H.noalias() = J.transpose() * WJ;
    cholesky_.block(cholesky_.diagonal_index(position)) += weight * H;
    diagonal_[position] += weight * H.diagonal();
    gradient_[position].noalias() += weight * (J.transpose() * information_v);
  };
  add_diagonal(i, terms.J_i, WJ_i);
  add_diagonal(j, terms.J_j, WJ_j);
  if (i < 0 || j < 0) return;
  if (i > j) {
    H.noalias() = terms.J_i.transpose() * WJ_j;
  } else {
    H.noalias() = terms.J_j.transpose() * WJ_i;
  }
  cholesky_.block(cholesky_.block_index(std::max(i, j), std::min(i, j))) += weight * H;
}

double ReducedSystem::smallest_pivot_ratio() const {
  double smallest = std::numeric_limits<double>::infinity();
  for (int p = 0; p < cholesky_.size(); ++p) {
    const Vector6 root = cholesky_.block(cholesky_.diagonal_index(p)).diagonal();
    smallest = std::min(smallest, (root.cwiseAbs2().array() / diagonal_[p].array()).minCoeff());
  }
  return smallest;
}

std::optional<double> ReducedSystem::step(const WindowState& state, double lambda, WindowState& next) {
  pose_steps_.resize(gradient_.size());
  for (std::size_t p = 0; p < gradient_.size(); ++p) pose_steps_[p] = -gradient_[p];
  cholesky_.solve(pose_steps_);
  // With damping D: promised decrease = -g^T delta + lambda delta^T D delta; elimination splits the first
  // term into one of the reduced system and |c|^2 of every point.
  double predicted = 0;
  for (std::size_t p = 0; p < gradient_.size(); ++p) {
    const Vector6& delta = pose_steps_[p];
    predicted += -gradient_[p].dot(delta) + lambda * delta.dot(diagonal_[p].cwiseProduct(delta));
  }
  elimination_.back_substitute(layout_, state.relative, pose_steps_, lambda, psi_steps_, predicted);
  if (!std::isfinite(predicted)) return std::nullopt;

  next.poses = state.poses;
  for (std::size_t i = 0; i < state.poses.size(); ++i) {
    const int p = layout_.position(static_cast<int>(i));
    if (p >= 0) next.poses[i] = SE3::exp(pose_steps_[p]) * state.poses[i];
  }
  next.psi.resize(state.psi.size());
  for (std::size_t k = 0; k < state.psi.size(); ++k) {
    next.psi[k] = state.psi[k] + psi_steps_[k];
    next.psi[k].z() = std::max(next.psi[k].z(), kMinInverseDepth);
  }
  relative_poses(layout_, next.poses, next.relative);
  return predicted;
}

double window_state_cost(const WindowProblem& problem, const WindowLayout& layout,
                         const WindowSolverOptions& options, const std::vector<Vector3>& psi_before,
                         WindowState& values) {
  double sum = points_cost(layout, ObservationModel(problem.rig), HuberKernel{options.huber_px},
                           values.relative, psi_before, values.psi);
  const HuberKernel kernel{options.constraint_huber};
  for (const auto& c : problem.constraints) {
    const Vector6 v = pose_constraint_error(c.T_j_i, values.poses[c.i], values.poses[c.j]);
    sum += kernel.rho(v.dot(c.information * v));
  }
  return sum;
}

}  // namespace twofold
