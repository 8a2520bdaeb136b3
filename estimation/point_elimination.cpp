#include "estimation/point_elimination.hpp"

#include <algorithm>
#include <cmath>

#include "estimation/block_kernels.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

int triangle_index(int row, int column) {
  return row * (row + 1) / 2 + column;
}

/// Lower Cholesky factor; false when V is not positive definite.
bool cholesky3(const Matrix3& V, Matrix3& L) {
  L.setZero();
  if (!(V(0, 0) > 0)) return false;
  L(0, 0) = std::sqrt(V(0, 0));
  L(1, 0) = V(1, 0) / L(0, 0);
  L(2, 0) = V(2, 0) / L(0, 0);
  const double pivot1 = V(1, 1) - L(1, 0) * L(1, 0);
  if (!(pivot1 > 0)) return false;
  L(1, 1) = std::sqrt(pivot1);
  L(2, 1) = (V(2, 1) - L(2, 0) * L(1, 0)) / L(1, 1);
  const double pivot2 = V(2, 2) - L(2, 0) * L(2, 0) - L(2, 1) * L(2, 1);
  if (!(pivot2 > 0)) return false;
  L(2, 2) = std::sqrt(pivot2);
  return true;
}

/// Ad(T) x for T = (R, t).
Vector6 apply_adjoint(const RelativePose& T, const Vector6& x) {
  const Vector3 Rw = T.R * x.tail<3>();
  Vector6 result;
  result << T.R * x.head<3>() + T.t.cross(Rw), Rw;
  return result;
}

}  // namespace

void PointElimination::eliminate(const WindowLayout& layout, const ObservationModel& model,
                                 const HuberKernel& kernel, const std::vector<RelativePose>& relative,
                                 const std::vector<Vector3>& psi, double lambda, BlockCholesky& system,
                                 std::span<Vector6> gradient, std::span<Vector6> diagonal) {
  points_.resize(layout.tracks().size());
  couplings_.resize(layout.entry_slots().size());
  for (const auto& group : layout.groups()) {
    hessian_.resize(std::max<std::size_t>(hessian_.size(), triangle_index(group.coupled_count, 0)));
    information_.resize(group.coupled_count);
    slot_gradient_.resize(group.coupled_count);
    set_all_zero(hessian_.data(), triangle_index(group.coupled_count, 0));
    set_all_zero(information_.data(), information_.size());
    set_all_zero(slot_gradient_.data(), slot_gradient_.size());
    const RelativePose* group_relative = relative.data() + group.first_slot;
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
      const auto& track = layout.tracks()[k];
      eliminate_track(track, layout.observations().data() + track.first_observation,
                      layout.entry_slots().data() + track.first_entry, model, kernel, group_relative, psi[k],
                      lambda, points_[k]);
    }
    add_group(layout, group, group_relative, system, gradient, diagonal);
  }
}

/// A^T W A and A^T W e of one observation: with A = J_x [I, -[x]x] and S = J_x^T W J_x they are
/// [S, -S X; X S, -X S X] and (f, x x f), X = [x]x. Only the lower triangle is summed.
void PointElimination::add_to_slot(int slot, const ObservationTerms& s, const Vector3& x) {
  Matrix6& H = information_[slot];
  H(0, 0) += s.s00, H(2, 0) += s.s02, H(1, 1) += s.s11, H(2, 1) += s.s12, H(2, 2) += s.s22;
  Matrix3 XS;
  XS.col(0) = x.cross(Vector3(s.s00, 0, s.s02));
  XS.col(1) = x.cross(Vector3(0, s.s11, s.s12));
  XS.col(2) = x.cross(Vector3(s.s02, s.s12, s.s22));
  H.bottomLeftCorner<3, 3>() += XS;
  // -X S X: rows of X S crossed by x.
  H(3, 3) += x.y() * XS(0, 2) - x.z() * XS(0, 1);
  H(4, 3) += x.y() * XS(1, 2) - x.z() * XS(1, 1);
  H(5, 3) += x.y() * XS(2, 2) - x.z() * XS(2, 1);
  H(4, 4) += x.z() * XS(1, 0) - x.x() * XS(1, 2);
  H(5, 4) += x.z() * XS(2, 0) - x.x() * XS(2, 2);
  H(5, 5) += x.x() * XS(2, 1) - x.y() * XS(2, 0);
  slot_gradient_[slot].head<3>() += s.force;
  slot_gradient_[slot].tail<3>() += x.cross(s.force);
}

void PointElimination::eliminate_track(const WindowLayout::Track& track,
                                       const WindowLayout::Observation* observations, const int* entry_slots,
                                       const ObservationModel& model, const HuberKernel& kernel,
                                       const RelativePose* relative, const Vector3& psi, double lambda,
                                       EliminatedPoint& point) {
  Matrix63* Y = couplings_.data() + track.first_entry;
  set_all_zero(Y, track.entry_count);
  const double inv_q = 1 / psi.z();
  const Vector3 y(psi.x() * inv_q, psi.y() * inv_q, inv_q);
  Matrix3 V = Matrix3::Zero();
  Vector3 g = Vector3::Zero();
  for (int n = 0; n < track.observation_count; ++n) {
    const auto& o = observations[n];
    const RelativePose& T = relative[o.slot];
    const Vector3 Ry = T.R * y;
    const Vector3 x = Ry + T.t;
    const ObservationTerms terms = model.linearise(x, o.z, o.information, kernel);
    Matrix3 J;  // d x / d psi  (B.20)
    J.col(0) = T.R.col(0) * inv_q;
    J.col(1) = T.R.col(1) * inv_q;
    J.col(2) = Ry * -inv_q;
    Matrix3 SJ;
    for (int c = 0; c < 3; ++c) SJ.col(c) = terms.apply(J.col(c));
    V.noalias() += J.transpose() * SJ;
    g.noalias() += J.transpose() * terms.force;
    if (o.entry < 0) continue;
    for (int c = 0; c < 3; ++c) {  // A^T W B
      Y[o.entry].col(c).head<3>() += SJ.col(c);
      Y[o.entry].col(c).tail<3>() += x.cross(SJ.col(c));
    }
    add_to_slot(o.slot, terms, x);
  }
  // A point at the bound that would like to go beyond infinity keeps its depth for this step.
  if (psi.z() <= kMinInverseDepth && g.z() > 0) {
    V.row(2).setZero(), V.col(2).setZero();
    V(2, 2) = V(0, 0) + V(1, 1);
    g.z() = 0;
    for (int n = 0; n < track.entry_count; ++n) Y[n].col(2).setZero();
  }
  point.damping = damping_diagonal(V);
  V.diagonal() += lambda * point.damping;
  if (!cholesky3(V, point.L)) {  // nothing pulls at this point: it stays, and has no say
    point.L.setIdentity();
    point.c.setZero();
    for (int n = 0; n < track.entry_count; ++n) Y[n].setZero();
    return;
  }
  const Matrix3& L = point.L;
  const double i0 = 1 / L(0, 0), i1 = 1 / L(1, 1), i2 = 1 / L(2, 2);
  Vector3& c = point.c;
  c[0] = g[0] * i0;
  c[1] = (g[1] - L(1, 0) * c[0]) * i1;
  c[2] = (g[2] - L(2, 0) * c[0] - L(2, 1) * c[1]) * i2;
  for (int n = 0; n < track.entry_count; ++n) {
    Matrix63& Yn = Y[n];
    Yn.col(0) *= i0;
    Yn.col(1) = (Yn.col(1) - L(1, 0) * Yn.col(0)) * i1;
    Yn.col(2) = (Yn.col(2) - L(2, 0) * Yn.col(0) - L(2, 1) * Yn.col(1)) * i2;
    slot_gradient_[entry_slots[n]].noalias() -= Yn * c;
    Matrix6* row = hessian_.data() + triangle_index(entry_slots[n], 0);
    for (int m = 0; m <= n; ++m) {
      add_outer_product<-1, 3>(row[entry_slots[m]].data(), Yn.data(), Y[m].data());
    }
  }
}

/// From slot to absolute coordinates, xi_i = delta_i - Ad_i delta_a: a block B of slots (i, j) goes to the
/// poses (i, j) as it is, to (i, a) as -B Ad_j and to (a, a) as Ad_i^T B Ad_j.
void PointElimination::add_group(const WindowLayout& layout, const WindowLayout::Group& group,
                                 const RelativePose* relative, BlockCholesky& system,
                                 std::span<Vector6> gradient, std::span<Vector6> diagonal) {
  const WindowLayout::Slot* slots = layout.slots().data() + group.first_slot;
  const bool anchor_free = group.anchor_position >= 0;
  adjoint_transposed_.resize(group.coupled_count);
  times_adjoint_.resize(group.coupled_count);
  set_all_zero(times_adjoint_.data(), times_adjoint_.size());
  for (int s = 0; s < group.coupled_count; ++s) {
    Matrix6& I = information_[s];
    I.triangularView<Eigen::StrictlyUpper>() = I.transpose();
    if (slots[s].position >= 0) {
      diagonal[slots[s].position] += I.diagonal();
      gradient[slots[s].position] += slot_gradient_[s];
    }
    if (anchor_free) {
      const RelativePose& T = relative[s];
      Matrix6& adjoint_transposed = adjoint_transposed_[s];
      adjoint_transposed << T.R.transpose(), Matrix3::Zero(), (hat(T.t) * T.R).transpose(), T.R.transpose();
      const Matrix6 AI = adjoint_transposed * I;
      diagonal[group.anchor_position] += AI.cwiseProduct(adjoint_transposed).rowwise().sum();
      gradient[group.anchor_position].noalias() -= adjoint_transposed * slot_gradient_[s];
    }
    hessian_[triangle_index(s, s)] += I;
  }
  for (int p = group.first_pair; p < group.first_pair + group.pair_count; ++p) {
    const auto& pair = layout.pairs()[p];
    const Matrix6& B = hessian_[triangle_index(pair.row, pair.column)];
    if (pair.block >= 0) system.block(pair.block) += B;
    if (!anchor_free) continue;
    add_outer_product<1, 6>(times_adjoint_[pair.row].data(), B.data(),
                            adjoint_transposed_[pair.column].data());
    if (pair.row != pair.column) {
      const Matrix6 Bt = B.transpose();
      add_outer_product<1, 6>(times_adjoint_[pair.column].data(), Bt.data(),
                              adjoint_transposed_[pair.row].data());
    }
  }
  if (!anchor_free) return;
  Matrix6& H_aa = system.block(system.diagonal_index(group.anchor_position));
  for (int s = 0; s < group.coupled_count; ++s) {
    const Matrix6 transposed = times_adjoint_[s].transpose();
    add_outer_product<1, 6>(H_aa.data(), transposed.data(), adjoint_transposed_[s].data());
    if (slots[s].anchor_block < 0) continue;
    if (slots[s].anchor_is_row) {
      system.block(slots[s].anchor_block) -= transposed;
    } else {
      system.block(slots[s].anchor_block) -= times_adjoint_[s];
    }
  }
}

void PointElimination::back_substitute(const WindowLayout& layout, const std::vector<RelativePose>& relative,
                                       std::span<const Vector6> pose_steps, double lambda,
                                       std::vector<Vector3>& psi_steps, double& predicted) {
  psi_steps.resize(layout.tracks().size());
  for (const auto& group : layout.groups()) {
    xi_.assign(group.coupled_count, Vector6::Zero());
    for (int s = 0; s < group.coupled_count; ++s) {
      const int position = layout.slots()[group.first_slot + s].position;
      if (position >= 0) xi_[s] = pose_steps[position];
      if (group.anchor_position >= 0) {
        xi_[s] -= apply_adjoint(relative[group.first_slot + s], pose_steps[group.anchor_position]);
      }
    }
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
      const auto& track = layout.tracks()[k];
      const EliminatedPoint& point = points_[k];
      Vector3 v = point.c;
      for (int n = track.first_entry; n < track.first_entry + track.entry_count; ++n) {
        v.noalias() += couplings_[n].transpose() * xi_[layout.entry_slots()[n]];
      }
      Vector3& step = psi_steps[k];
      step[2] = -v[2] / point.L(2, 2);
      step[1] = (-v[1] - point.L(2, 1) * step[2]) / point.L(1, 1);
      step[0] = (-v[0] - point.L(1, 0) * step[1] - point.L(2, 0) * step[2]) / point.L(0, 0);
      predicted += point.c.squaredNorm() + lambda * step.dot(point.damping.cwiseProduct(step));
    }
  }
}

void relative_poses(const WindowLayout& layout, const std::vector<SE3>& poses,
                    std::vector<RelativePose>& relative) {
  relative.resize(layout.slots().size());
  for (const auto& group : layout.groups()) {
    const SE3 T_w_a = poses[group.anchor].inverse();
    for (int s = group.first_slot; s < group.first_slot + group.slot_count; ++s) {
      const int pose = layout.slots()[s].pose;
      const SE3 T_i_a = pose == group.anchor ? SE3() : poses[pose] * T_w_a;
      relative[s] = {T_i_a.rotation(), T_i_a.translation()};
    }
  }
}

double points_cost(const WindowLayout& layout, const ObservationModel& model, const HuberKernel& kernel,
                   const std::vector<RelativePose>& relative, const std::vector<Vector3>& psi_before,
                   std::vector<Vector3>& psi) {
  double cost = 0;
  for (const auto& group : layout.groups()) {
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
      const auto& track = layout.tracks()[k];
      const auto track_cost = [&](const Vector3& at) {
        const Vector3 y = from_inverse_depth(at);
        double sum = 0;
        for (int n = track.first_observation; n < track.first_observation + track.observation_count; ++n) {
          const auto& o = layout.observations()[n];
          const RelativePose& T = relative[group.first_slot + o.slot];
          sum += kernel.rho(model.chi2(T.R * y + T.t, o.z, o.information));
        }
        return sum;
      };
      double sum = track_cost(psi[k]);
      if (!std::isfinite(sum)) sum = track_cost(psi[k] = psi_before[k]);
      if (!std::isfinite(sum)) return std::numeric_limits<double>::infinity();
      cost += sum;
    }
  }
  return cost;
}

}  // namespace twofold
