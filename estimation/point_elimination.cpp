#include "estimation/point_elimination.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/inverse_depth.hpp"
#include "sparse/block_kernels.hpp"

namespace twofold {
namespace {

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
Vector6 apply_adjoint(const RigidMotion& T, const Vector6& x) {
  const Vector3 Rw = T.R * x.tail<3>();
  Vector6 result;
  result << T.R * x.head<3>() + T.t.cross(Rw), Rw;
  return result;
}

/// First three columns of the matrix with these rows.
struct Columns {
  Packet4 column[3];
  Columns(const Packet4& r0, const Packet4& r1, const Packet4& r2, const Packet4& r3) {
    const Packet4 even_01 = __builtin_shufflevector(r0, r1, 0, 4, 2, 6);
    const Packet4 even_23 = __builtin_shufflevector(r2, r3, 0, 4, 2, 6);
    const Packet4 odd_01 = __builtin_shufflevector(r0, r1, 1, 5, 3, 7);
    const Packet4 odd_23 = __builtin_shufflevector(r2, r3, 1, 5, 3, 7);
    column[0] = __builtin_shufflevector(even_01, even_23, 0, 1, 4, 5);
    column[1] = __builtin_shufflevector(odd_01, odd_23, 0, 1, 4, 5);
    column[2] = __builtin_shufflevector(even_01, even_23, 2, 3, 6, 7);
  }
};

/// Y = U L^-T, by rows 0-3 and 2-5 of its columns.
void solve_coupling(const CouplingRows& U, const Matrix3& L, const Vector3& inverse_diagonal,
                    PointElimination::Matrix63& Y) {
  const auto solve = [&](Columns& u) {
    u.column[0] *= inverse_diagonal[0];
    u.column[1] = (u.column[1] - L(1, 0) * u.column[0]) * inverse_diagonal[1];
    u.column[2] = (u.column[2] - L(2, 0) * u.column[0] - L(2, 1) * u.column[1]) * inverse_diagonal[2];
  };
  const auto &t = U.translation.row, &r = U.rotation.row;
  Columns low(t[0], t[1], t[2], r[0]), high(t[2], r[0], r[1], r[2]);
  solve(low);
  solve(high);
  for (int c = 0; c < 3; ++c) {
    store4(Y.data() + 6 * c + 2, high.column[c]);
    store4(Y.data() + 6 * c, low.column[c]);
  }
}

void forget_depth(CouplingRows& U) {
  for (int r = 0; r < 3; ++r) U.translation.row[r][2] = U.rotation.row[r][2] = 0;
}

}  // namespace

void PointElimination::eliminate(const WindowLayout& layout, const ObservationModel& model,
                                 const HuberKernel& kernel, const std::vector<RigidMotion>& relative,
                                 const std::vector<Vector3>& psi, double lambda, BlockCholesky& system,
                                 std::span<Vector6> gradient, std::span<Vector6> diagonal) {
  points_.resize(layout.tracks().size());
  couplings_.resize(layout.entry_slots().size());
  for (const Group& group : layout.groups()) {
    sums_.assign(group.coupled_count, {});
    eliminated_gradient_.assign(group.coupled_count, Vector6::Zero());
    anchor_couplings_.resize(group.coupled_count);
    set_all_zero(anchor_couplings_.data(), anchor_couplings_.size());
    anchor_hessian_.setZero();
    const RigidMotion* group_relative = relative.data() + group.first_slot;
    for (int k = group.first_track; k < group.first_track + group.track_count; ++k) {
      const auto& track = layout.tracks()[k];
      PointEquations equations = linearise(layout, track, model, kernel, group_relative, psi[k]);
      eliminate_track(layout, group, track, equations, lambda, system, points_[k]);
    }
    add_group(layout, group, group_relative, system, gradient, diagonal);
  }
}

PointElimination::PointEquations PointElimination::linearise(
    const WindowLayout& layout, const WindowLayout::Track& track, const ObservationModel& model,
    const HuberKernel& kernel, const RigidMotion* relative, const Vector3& psi) {
  coupling_rows_.assign(track.entry_count, {});
  const double inv_q = 1 / psi.z();
  const Vector3 y(psi.x() * inv_q, psi.y() * inv_q, inv_q);
  Rows3 F, F_coupled;  // sum R_i^T S_i dx_i/dpsi
  Packet4 g = {};
  const WindowLayout::Observation* first = &layout.observations()[track.first_observation];
  for (const auto* o = first; o != first + track.observation_count; ++o) {
    const RigidMotion& T = relative[o->slot];
    const Vector3 Ry = T.R * y;
    const Vector3 x = Ry + T.t;
    const ObservationTerms terms = model.linearise(x, o->pixel, o->information, kernel);
    Rows3 J;  // d x / d psi  (B.20)
    for (int r = 0; r < 3; ++r) {
      J.row[r] = Packet4{T.R(r, 0), T.R(r, 1), -Ry[r], 0} * inv_q;
      g += terms.force[r] * J.row[r];
    }
    const Rows3 SJ = apply(terms, J);
    const Rows3 RSJ = transposed_times(T.R, SJ);
    F += RSJ;
    if (o->entry < 0) continue;
    F_coupled += RSJ;
    coupling_rows_[o->entry] += {SJ, cross(x, SJ)};
    sums_[o->slot].add(terms, x);
  }
  // dy/dpsi = [e1, e2, -y] / q
  const Packet4 V2 = -(y.x() * F.row[0] + y.y() * F.row[1] + y.z() * F.row[2]);
  PointEquations equations;
  for (int c = 0; c < 3; ++c) {
    equations.V.col(c) = inv_q * Vector3(F.row[0][c], F.row[1][c], V2[c]);
    equations.g[c] = g[c];
  }
  const Rows3 torque = cross(y, F_coupled);
  for (int r = 0; r < 3; ++r) {
    equations.anchor.translation.row[r] = -F_coupled.row[r];
    equations.anchor.rotation.row[r] = -torque.row[r];
  }
  // A point at the bound that would like to go beyond infinity keeps its depth for this step.
  if (psi.z() <= kMinInverseDepth && equations.g.z() > 0) fix_depth(equations);
  return equations;
}

void PointElimination::fix_depth(PointEquations& equations) {
  auto& [V, g, anchor] = equations;
  V.row(2).setZero(), V.col(2).setZero();
  V(2, 2) = V(0, 0) + V(1, 1);
  g.z() = 0;
  forget_depth(anchor);
  for (CouplingRows& U : coupling_rows_) forget_depth(U);
}

void PointElimination::eliminate_track(const WindowLayout& layout, const Group& group,
                                       const WindowLayout::Track& track, PointEquations& equations,
                                       double lambda, BlockCholesky& system, EliminatedPoint& point) {
  auto& [V, g, anchor] = equations;
  Matrix63* Y = couplings_.data() + track.first_entry;
  point.damping = damping_diagonal(V);
  V.diagonal() += lambda * point.damping;
  if (!cholesky3(V, point.L)) {  // nothing pulls at this point: it stays, and has no say
    point.L.setIdentity();
    point.c.setZero();
    for (int n = 0; n < track.entry_count; ++n) Y[n].setZero();
    return;
  }
  const Matrix3& L = point.L;
  const Vector3 inverse_diagonal = L.diagonal().cwiseInverse();
  Vector3& c = point.c;
  c[0] = g[0] * inverse_diagonal[0];
  c[1] = (g[1] - L(1, 0) * c[0]) * inverse_diagonal[1];
  c[2] = (g[2] - L(2, 0) * c[0] - L(2, 1) * c[1]) * inverse_diagonal[2];
  for (int n = 0; n < track.entry_count; ++n) solve_coupling(coupling_rows_[n], L, inverse_diagonal, Y[n]);
  Matrix63 Y_anchor;
  solve_coupling(anchor, L, inverse_diagonal, Y_anchor);

  const int* slots = layout.entry_slots().data() + track.first_entry;
  const bool anchor_free = group.anchor_position >= 0;
  for (int n = 0; n < track.entry_count; ++n) {
    const int s = slots[n];
    eliminated_gradient_[s].noalias() += Y[n] * c;
    const int* blocks = layout.blocks().data() + group.first_block + s * (s + 1) / 2;
    for (int m = 0; m <= n; ++m) {
      const int block = blocks[slots[m]];
      if (block >= 0) add_outer_product<-1, 3>(system.block(block).data(), Y[n].data(), Y[m].data());
    }
    if (anchor_free) add_outer_product<-1, 3>(anchor_couplings_[s].data(), Y[n].data(), Y_anchor.data());
  }
  if (anchor_free) add_outer_product<-1, 3>(anchor_hessian_.data(), Y_anchor.data(), Y_anchor.data());
}

/// What the observations say of the slots themselves, and the anchor's share: a block B of slot i goes to the
/// poses (i, a) as -B Ad_i and to (a, a) as Ad_i^T B Ad_i.
void PointElimination::add_group(const WindowLayout& layout, const Group& group, const RigidMotion* relative,
                                 BlockCholesky& system, std::span<Vector6> gradient,
                                 std::span<Vector6> diagonal) {
  const WindowLayout::Slot* slots = layout.slots().data() + group.first_slot;
  const int a = group.anchor_position;
  for (int s = 0; s < group.coupled_count; ++s) {
    const Matrix6 B = sums_[s].hessian();
    const Vector6 g = sums_[s].gradient() - eliminated_gradient_[s];
    if (const int p = slots[s].position; p >= 0) {
      system.block(system.diagonal_index(p)) += B;
      diagonal[p] += B.diagonal();
      gradient[p] += g;
    }
    if (a < 0) continue;
    const Matrix6 A = adjoint_transposed(relative[s]);
    Matrix6 AB = Matrix6::Zero();  // Ad^T B
    add_outer_product<1, 6>(AB.data(), A.data(), B.data());
    add_outer_product<1, 6>(anchor_hessian_.data(), AB.data(), A.data());
    diagonal[a] += AB.cwiseProduct(A).rowwise().sum();
    gradient[a].noalias() -= A * g;
    if (slots[s].anchor_block < 0) continue;
    if (slots[s].anchor_is_row) {
      system.block(slots[s].anchor_block) += anchor_couplings_[s].transpose() - AB;
    } else {
      system.block(slots[s].anchor_block) += anchor_couplings_[s] - AB.transpose();
    }
  }
  if (a >= 0) system.block(system.diagonal_index(a)) += anchor_hessian_;
}

void PointElimination::back_substitute(const WindowLayout& layout, const std::vector<RigidMotion>& relative,
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

}  // namespace twofold
