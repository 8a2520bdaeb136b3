#include "filters/batched_views.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <limits>

namespace twofold {
namespace {

constexpr double kImpossible = std::numeric_limits<double>::infinity();

[[gnu::always_inline]] inline PointLanes dot(const PointTriple& a, const PointTriple& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

[[gnu::always_inline]] inline PointTriple symmetric_times(const PointTriangle& M, const PointTriple& x) {
  return {M.m00 * x[0] + M.m10 * x[1] + M.m20 * x[2], M.m10 * x[0] + M.m11 * x[1] + M.m21 * x[2],
          M.m20 * x[0] + M.m21 * x[1] + M.m22 * x[2]};
}

[[gnu::always_inline]] inline PointTriple lower_times(const PointTriangle& L, const PointTriple& x) {
  return {L.m00 * x[0], L.m10 * x[0] + L.m11 * x[1], L.m20 * x[0] + L.m21 * x[1] + L.m22 * x[2]};
}

[[gnu::always_inline]] inline PointTriple transposed_times(const PointTriangle& L, const PointTriple& x) {
  return {L.m00 * x[0] + L.m10 * x[1] + L.m20 * x[2], L.m11 * x[1] + L.m21 * x[2], L.m22 * x[2]};
}

/// Inverse of the Cholesky factor.
[[gnu::always_inline]] inline PointTriangle inverse_root(const PointTriangle& M) {
  PointTriangle inverse;
  inverse.m00 = M.m00.sqrt().inverse();
  const PointLanes l10 = M.m10 * inverse.m00, l20 = M.m20 * inverse.m00;
  inverse.m11 = (M.m11 - l10.square()).sqrt().inverse();
  const PointLanes l21 = (M.m21 - l20 * l10) * inverse.m11;
  inverse.m22 = (M.m22 - l20.square() - l21.square()).sqrt().inverse();
  inverse.m10 = -l10 * inverse.m00 * inverse.m11;
  inverse.m21 = -l21 * inverse.m11 * inverse.m22;
  inverse.m20 = -(l20 * inverse.m00 + l21 * inverse.m10) * inverse.m22;
  return inverse;
}

/// project_inverse_depth of many points in one view, without what an adjustment has no use for:
/// h = R (x/z, y/z, 1) + q t is linear in psi.
struct RayOfPsi {
  Matrix3 linear;
  Vector3 constant;

  explicit RayOfPsi(const SE3& T_c_a) {
    const Matrix3 R = T_c_a.rotation();
    linear << R.leftCols<2>(), T_c_a.translation();
    constant = R.col(2);
  }
  [[gnu::always_inline]] [[nodiscard]] PointLanes row(int r, const PointTriple& psi) const {
    return linear(r, 0) * psi[0] + linear(r, 1) * psi[1] + linear(r, 2) * psi[2] + constant[r];
  }
};

/// Four points in a view.
struct BatchInView {
  PointLanes u, v, inv_z;  ///< h over its depth, and one over that
  PointLanes in_front;     ///< > 0 where the point is in front of the camera

  [[gnu::always_inline]] BatchInView(const RayOfPsi& ray, const PointTriple& psi) {
    const PointLanes x = ray.row(0, psi), y = ray.row(1, psi), z = ray.row(2, psi);
    inv_z = z.inverse();
    u = x * inv_z;
    v = y * inv_z;
    in_front = z - kFlattestRay * x.abs().max(y.abs());
  }
};

/// Derivatives of four points' whitened pixels. Of those by the pose the zeros are left out: u does not
/// depend on how the camera moves along y, nor v on how it moves along x.
struct BatchDerivatives {
  std::array<PointLanes, 5> u_by_pose, v_by_pose;
  PointTriple u_by_psi, v_by_psi;

  [[gnu::always_inline]] BatchDerivatives(const RayOfPsi& ray, const PointTriple& psi, const BatchInView& p,
                                          const PointLanes& fx, const PointLanes& fy) {
    const PointLanes a = fx * p.inv_z, c = fy * p.inv_z, uv = p.u * p.v;
    const PointLanes qa = psi[2] * a, qc = psi[2] * c;
    u_by_pose = {qa, -qa * p.u, -fx * uv, fx + fx * p.u.square(), -fx * p.v};
    v_by_pose = {qc, -qc * p.v, -fy - fy * p.v.square(), fy * uv, fy * p.u};
    for (int k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(k);
      u_by_psi[at] = a * (ray.linear(0, k) - p.u * ray.linear(2, k));
      v_by_psi[at] = c * (ray.linear(1, k) - p.v * ray.linear(2, k));
    }
  }
};

/// What one view's pose has in the normal equations, summed over points.
struct PoseSums {
  std::array<PointLanes, 21> C;  ///< lower triangle, row by row
  std::array<PointLanes, 6> g;

  PoseSums() {
    for (PointLanes& sum : C) sum.setZero();
    for (PointLanes& sum : g) sum.setZero();
  }
  /// @param kFirst  the one of the first two columns that is not zero
  template <std::size_t kFirst>
  [[gnu::always_inline]] void add(const std::array<PointLanes, 5>& J, const PointLanes& d) {
    constexpr std::array<std::size_t, 5> kColumn{kFirst, 2, 3, 4, 5};
#pragma GCC unroll 5
    for (std::size_t i = 0; i < 5; ++i) {
      g[kColumn[i]] += J[i] * d;
#pragma GCC unroll 5
      for (std::size_t j = 0; j <= i; ++j) C[at(kColumn[i], kColumn[j])] += J[i] * J[j];
    }
  }
  void write(Eigen::Ref<Eigen::MatrixXd> C_view, Eigen::Ref<Eigen::VectorXd> g_view) const {
    for (std::size_t row = 0; row < 6; ++row) {
      const auto r = static_cast<Eigen::Index>(row);
      g_view[r] = g[row].sum();
      for (std::size_t col = 0; col <= row; ++col)
        C_view(r, static_cast<Eigen::Index>(col)) = C[at(row, col)].sum();
    }
  }

 private:
  static constexpr std::size_t at(std::size_t row, std::size_t col) {
    return row * (row + 1) / 2 + col;
  }
};

}  // namespace

BatchedViews::BatchedViews(const AnchoredViews& views)
    : fx_(views.camera.fx / views.sigma_px),
      fy_(views.camera.fy / views.sigma_px),
      point_count_(views.points.size()) {
  const std::size_t count = (point_count_ + kPointLanes - 1) / kPointLanes;
  points_.resize(count);
  start_.psi.resize(count);
  for (std::size_t j = 0; j < count * kPointLanes; ++j)
    add_point(j, views.points[std::min(j, point_count_ - 1)]);
  for (const AnchoredViews::View& view : views.views) {
    start_.T_c_a.push_back(view.T_c_a);
    std::vector<Seen>& seen = seen_.emplace_back(count);
    for (std::size_t j = 0; j < count * kPointLanes; ++j) {
      const Vector2& uv = view.pixels[std::min(j, point_count_ - 1)];
      const auto lane = static_cast<Eigen::Index>(j % kPointLanes);
      seen[j / kPointLanes].u[lane] = uv.x();
      seen[j / kPointLanes].v[lane] = uv.y();
    }
    for (Seen& batch : seen) {
      batch.u = (batch.u - views.camera.cx) / views.camera.fx;
      batch.v = (batch.v - views.camera.cy) / views.camera.fy;
    }
  }
}

void BatchedViews::add_point(std::size_t j, const AnchoredViews::Point& point) {
  const auto lane = static_cast<Eigen::Index>(j % kPointLanes);
  PointTriple& psi = start_.psi[j / kPointLanes];
  Batch& batch = points_[j / kPointLanes];
  for (std::size_t k = 0; k < 3; ++k) {
    psi[k][lane] = point.psi[static_cast<Eigen::Index>(k)];
    batch.psi_prior[k][lane] = point.psi_prior[static_cast<Eigen::Index>(k)];
  }
  batch.prior.m00[lane] = point.prior(0, 0);
  batch.prior.m10[lane] = point.prior(1, 0);
  batch.prior.m11[lane] = point.prior(1, 1);
  batch.prior.m20[lane] = point.prior(2, 0);
  batch.prior.m21[lane] = point.prior(2, 1);
  batch.prior.m22[lane] = point.prior(2, 2);
  batch.used[lane] = j < point_count_ ? 1 : 0;
}

void BatchedViews::write(const AnchoredState& state, AnchoredViews& views) const {
  for (std::size_t j = 0; j < point_count_; ++j) {
    const PointTriple& psi = state.psi[j / kPointLanes];
    const auto lane = static_cast<Eigen::Index>(j % kPointLanes);
    views.points[j].psi = {psi[0][lane], psi[1][lane], psi[2][lane]};
  }
  for (std::size_t v = 0; v < views.views.size(); ++v) views.views[v].T_c_a = state.T_c_a[v];
}

PointLanes BatchedViews::prior_error(std::size_t n, const PointTriple& psi) const {
  PointTriple x;
  for (std::size_t k = 0; k < 3; ++k) x[k] = psi[k] - points_[n].psi_prior[k];
  return dot(x, symmetric_times(points_[n].prior, x));
}

double BatchedViews::cost(const AnchoredState& state) const {
  PointLanes sum = PointLanes::Zero(), in_front = PointLanes::Ones();
  for (std::size_t n = 0; n < batches(); ++n) sum += points_[n].used * prior_error(n, state.psi[n]);
  for (std::size_t v = 0; v < seen_.size(); ++v) {
    const RayOfPsi ray(state.T_c_a[v]);
    for (std::size_t n = 0; n < batches(); ++n) {
      const BatchInView p(ray, state.psi[n]);
      sum +=
          points_[n].used * ((fx_ * (seen_[v][n].u - p.u)).square() + (fy_ * (seen_[v][n].v - p.v)).square());
      in_front = in_front.min(p.in_front);
    }
  }
  return in_front.minCoeff() > 0 ? sum.sum() : kImpossible;
}

std::vector<double> BatchedViews::worst_errors(const AnchoredState& state) const {
  std::vector<PointLanes> worst(batches());
  for (std::size_t n = 0; n < batches(); ++n) worst[n] = prior_error(n, state.psi[n]);
  for (std::size_t v = 0; v < seen_.size(); ++v) {
    const RayOfPsi ray(state.T_c_a[v]);
    for (std::size_t n = 0; n < batches(); ++n) {
      const BatchInView p(ray, state.psi[n]);
      const PointLanes error =
          (fx_ * (seen_[v][n].u - p.u)).square() + (fy_ * (seen_[v][n].v - p.v)).square();
      worst[n] = worst[n].max((p.in_front > 0).select(error, kImpossible));
    }
  }
  std::vector<double> result;
  for (std::size_t j = 0; j < point_count_; ++j)
    result.push_back(worst[j / kPointLanes][static_cast<Eigen::Index>(j % kPointLanes)]);
  return result;
}

void BatchedViews::linearise(const AnchoredState& state) {
  const std::size_t views = seen_.size();
  C_.setZero(static_cast<Eigen::Index>(6 * views), static_cast<Eigen::Index>(6 * views));
  g_poses_.resize(C_.rows());
  D_.resize(batches());
  g_points_.resize(batches());
  E_T_.resize(2 * views * batches());
  for (std::size_t n = 0; n < batches(); ++n) {
    PointTriple x;
    for (std::size_t k = 0; k < 3; ++k) x[k] = points_[n].psi_prior[k] - state.psi[n][k];
    D_[n] = points_[n].prior;
    g_points_[n] = symmetric_times(points_[n].prior, x);
  }
  for (std::size_t v = 0; v < views; ++v) linearise_view(v, state);
}

void BatchedViews::linearise_view(std::size_t v, const AnchoredState& state) {
  const RayOfPsi ray(state.T_c_a[v]);
  PoseSums sums;
  const std::span<PointRows> by_translation = rows(2 * v), by_rotation = rows(2 * v + 1);
  for (std::size_t n = 0; n < batches(); ++n) {
    const PointLanes fx = fx_ * points_[n].used, fy = fy_ * points_[n].used;
    const BatchInView p(ray, state.psi[n]);
    const PointLanes du = fx * (seen_[v][n].u - p.u), dv = fy * (seen_[v][n].v - p.v);
    const BatchDerivatives J(ray, state.psi[n], p, fx, fy);
    sums.add<0>(J.u_by_pose, du);
    sums.add<1>(J.v_by_pose, dv);
    const PointTriple &a = J.u_by_psi, &b = J.v_by_psi;
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
      g_points_[n][k] += a[k] * du + b[k] * dv;
      by_translation[n][0][k] = J.u_by_pose[0] * a[k];
      by_translation[n][1][k] = J.v_by_pose[0] * b[k];
      by_translation[n][2][k] = J.u_by_pose[1] * a[k] + J.v_by_pose[1] * b[k];
#pragma GCC unroll 3
      for (std::size_t r = 0; r < 3; ++r)
        by_rotation[n][r][k] = J.u_by_pose[2 + r] * a[k] + J.v_by_pose[2 + r] * b[k];
    }
    PointTriangle& D = D_[n];
    D.m00 += a[0] * a[0] + b[0] * b[0];
    D.m10 += a[1] * a[0] + b[1] * b[0];
    D.m11 += a[1] * a[1] + b[1] * b[1];
    D.m20 += a[2] * a[0] + b[2] * b[0];
    D.m21 += a[2] * a[1] + b[2] * b[1];
    D.m22 += a[2] * a[2] + b[2] * b[2];
  }
  const auto pose = static_cast<Eigen::Index>(6 * v);
  sums.write(C_.block(pose, pose, 6, 6), g_poses_.segment(pose, 6));
}

void BatchedViews::eliminate_points(double damping) {
  for (std::size_t n = 0; n < batches(); ++n) {
    PointTriangle damped = D_[n];
    damped.m00 += damping * (damped.m00 + 1);
    damped.m11 += damping * (damped.m11 + 1);
    damped.m22 += damping * (damped.m22 + 1);
    D_[n] = inverse_root(damped);
    g_points_[n] = lower_times(D_[n], g_points_[n]);
  }
  for (std::size_t triple = 0; triple < 2 * seen_.size(); ++triple) {
    const std::span<PointRows> triple_rows = rows(triple);
    for (std::size_t n = 0; n < batches(); ++n) {
      for (PointTriple& row : triple_rows[n]) row = lower_times(D_[n], row);
    }
  }
}

namespace {

/// Sum of A B^T over all points.
Matrix3 sum_of_products(std::span<const PointRows> A, std::span<const PointRows> B) {
  std::array<PointLanes, 9> sums;
  for (PointLanes& sum : sums) sum.setZero();
  for (std::size_t n = 0; n < A.size(); ++n) {
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) {
#pragma GCC unroll 3
      for (std::size_t r = 0; r < 3; ++r) {
#pragma GCC unroll 3
        for (std::size_t c = 0; c < 3; ++c) sums[3 * r + c] += A[n][r][k] * B[n][c][k];
      }
    }
  }
  Matrix3 result;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) result(r, c) = sums[static_cast<std::size_t>(3 * r + c)].sum();
  }
  return result;
}

/// Sum of A x over all points.
Vector3 sum_of_products(std::span<const PointRows> A, std::span<const PointTriple> x) {
  PointTriple sums;
  for (PointLanes& sum : sums) sum.setZero();
  for (std::size_t n = 0; n < A.size(); ++n) {
#pragma GCC unroll 3
    for (std::size_t r = 0; r < 3; ++r) sums[r] += dot(A[n][r], x[n]);
  }
  return {sums[0].sum(), sums[1].sum(), sums[2].sum()};
}

/// Takes A^T y away from x, for each point.
void subtract_products(std::span<const PointRows> A, const Vector3& y, std::span<PointTriple> x) {
  for (std::size_t n = 0; n < A.size(); ++n) {
#pragma GCC unroll 3
    for (std::size_t k = 0; k < 3; ++k) x[n][k] -= y[0] * A[n][0][k] + y[1] * A[n][1][k] + y[2] * A[n][2][k];
  }
}

}  // namespace

bool BatchedViews::step(double damping, const AnchoredState& from, AnchoredState& to) {
  eliminate_points(damping);
  Eigen::MatrixXd S = C_;
  S.diagonal() += damping * (C_.diagonal().array() + 1).matrix();
  Eigen::VectorXd poses_step = g_poses_;
  eliminate_from_poses(S, poses_step);
  const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> llt(S);
  if (llt.info() != Eigen::Success) return false;
  llt.solveInPlace(poses_step);
  if (!poses_step.allFinite()) return false;
  for (std::size_t v = 0; v < seen_.size(); ++v)
    to.T_c_a[v] = SE3::exp(poses_step.segment<6>(static_cast<Eigen::Index>(6 * v))) * from.T_c_a[v];
  for (std::size_t i = 0; i < 2 * seen_.size(); ++i)
    subtract_products(rows(i), poses_step.segment<3>(static_cast<Eigen::Index>(3 * i)), g_points_);
  for (std::size_t n = 0; n < batches(); ++n) {
    const PointTriple move = transposed_times(D_[n], g_points_[n]);
    for (std::size_t k = 0; k < 3; ++k) to.psi[n][k] = from.psi[n][k] + move[k];
  }
  return true;
}

void BatchedViews::eliminate_from_poses(Eigen::MatrixXd& S, Eigen::VectorXd& rhs) const {
  for (std::size_t i = 0; i < 2 * seen_.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    rhs.segment<3>(row) -= sum_of_products(rows(i), std::span(g_points_));
    for (std::size_t j = 0; j <= i; ++j)
      S.block<3, 3>(row, static_cast<Eigen::Index>(3 * j)) -= sum_of_products(rows(i), rows(j));
  }
}

Eigen::MatrixXd BatchedViews::information() const {
  const auto all_points = static_cast<Eigen::Index>(3 * point_count_);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(all_points + C_.rows(), all_points + C_.rows());
  for (std::size_t j = 0; j < point_count_; ++j) {
    const std::size_t n = j / kPointLanes;
    const auto lane = static_cast<Eigen::Index>(j % kPointLanes), at = static_cast<Eigen::Index>(3 * j);
    const PointTriangle& D = D_[n];
    H.block<3, 3>(at, at) << D.m00[lane], 0, 0, D.m10[lane], D.m11[lane], 0, D.m20[lane], D.m21[lane],
        D.m22[lane];
    for (Eigen::Index row = 0; row < C_.rows(); ++row) {
      const PointRows& E_T = rows(static_cast<std::size_t>(row / 3))[n];
      for (Eigen::Index k = 0; k < 3; ++k)
        H(all_points + row, at + k) =
            E_T[static_cast<std::size_t>(row % 3)][static_cast<std::size_t>(k)][lane];
    }
  }
  H.bottomRightCorner(C_.rows(), C_.rows()) = C_;
  return H.selfadjointView<Eigen::Lower>();
}

}  // namespace twofold
