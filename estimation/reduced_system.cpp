#include "estimation/reduced_system.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/pose_constraint.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {

WindowState ReducedSystem::start(const WindowProblem& problem) {
  layout_.build(problem, cholesky_);
  WindowState state;
  state.poses.reserve(problem.poses.size());
  state.psi.reserve(layout_.tracks().size());
  for (const auto& pose : problem.poses) state.poses.push_back(pose.T_k_w);
  for (const auto& track : layout_.tracks()) state.psi.push_back(problem.points[track.point].psi);
  state.relate(problem, layout_);
  return state;
}

void ReducedSystem::build(const WindowProblem& problem, const WindowSolverOptions& options,
                          const WindowState& state, double lambda) {
  cholesky_.set_zero();
  gradient_.assign(cholesky_.size(), Vector6::Zero());
  diagonal_.assign(cholesky_.size(), Vector6::Zero());
  elimination_.eliminate(layout_, ObservationModel(problem.rig), HuberKernel{options.huber_sigmas},
                         state.relative, state.psi, lambda, cholesky_, gradient_, diagonal_);
  const HuberKernel kernel{options.constraint_huber};
  for (std::size_t n = 0; n < problem.constraints.size(); ++n) {
    const auto& c = problem.constraints[n];
    add_constraint(c, layout_.constraints()[n], kernel,
                   relative_motion(state.matrices[c.j], state.matrices[c.i]), state.constraint_errors[n]);
  }

  // Where nothing pulls at a pose in some direction, a share of what pulls at the average pose damps it.
  Vector6 mean = Vector6::Zero();
  for (const Vector6& d : diagonal_) mean += d / static_cast<double>(diagonal_.size());
  for (int p = 0; p < cholesky_.size(); ++p) {
    diagonal_[p] = diagonal_[p].cwiseMax(1e-6 * mean);
    cholesky_.block(cholesky_.diagonal_index(p)).diagonal() += lambda * diagonal_[p];
  }
}

/// With B = -dv/d delta_j, K = B^T Lambda B and Ad that of T_j T_i^-1: dv/d delta_i = B Ad, so that the
/// blocks are K, Ad^T K Ad and -Ad^T K.
void ReducedSystem::add_constraint(const WindowProblem::PoseConstraint& c,
                                   const WindowLayout::ConstraintPlace& place, const HuberKernel& kernel,
                                   const RigidMotion& T_j_i, const Vector6& v) {
  const auto [i, j, block] = place;
  if (i < 0 && j < 0) return;
  const double weight = kernel.weight(v.dot(c.information * v));
  // With the inverse left Jacobian [P Q; 0 P] at v, B is that at -v, and P(-v) = P(v)^T, Q(-v) = Q(v)^T.
  Matrix6 B_transposed = se3_left_jacobian_inverse(v);
  B_transposed.bottomLeftCorner<3, 3>() = B_transposed.topRightCorner<3, 3>();
  B_transposed.topRightCorner<3, 3>().setZero();
  Matrix6 BL = Matrix6::Zero(), K = Matrix6::Zero();  // B^T Lambda, B^T Lambda B
  add_outer_product<1, 6>(BL.data(), B_transposed.data(), c.information.data());
  BL *= weight;
  add_outer_product<1, 6>(K.data(), BL.data(), B_transposed.data());
  const Vector6 force = BL * v;
  if (j >= 0) {
    cholesky_.block(cholesky_.diagonal_index(j)) += K;
    diagonal_[j] += K.diagonal();
    gradient_[j] -= force;
  }
  if (i < 0) return;
  const Matrix6 A = adjoint_transposed(T_j_i);
  Matrix6 AK = Matrix6::Zero();
  add_outer_product<1, 6>(AK.data(), A.data(), K.data());
  add_outer_product<1, 6>(cholesky_.block(cholesky_.diagonal_index(i)).data(), AK.data(), A.data());
  diagonal_[i] += AK.cwiseProduct(A).rowwise().sum();
  gradient_[i].noalias() += A * force;
  if (block < 0) return;
  if (i > j) {
    cholesky_.block(block) -= AK;
  } else {
    cholesky_.block(block) -= AK.transpose();
  }
}

std::optional<double> ReducedSystem::advance(const WindowProblem& problem, const WindowState& state,
                                             double lambda, WindowState& next) {
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
  next.relate(problem, layout_);
  return predicted;
}

}  // namespace twofold
