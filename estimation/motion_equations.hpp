#pragma once

#include <algorithm>
#include <cstring>
#include <span>

#include "estimation/motion_only.hpp"
#include "estimation/observation_model.hpp"
#include "estimation/robust_kernel.hpp"

namespace twofold {

// What one pass of motion-only adjustment over the observations does with them, four at a time.

inline constexpr int kObservationLanes = 4;
using ObservationLanes = Eigen::Array<double, kObservationLanes, 1>;

/// As the compiler's own vectors, which choose lane by lane without a branch.
using ObservationRegister = double __attribute__((vector_size(sizeof(double) * kObservationLanes)));

[[gnu::always_inline]] inline ObservationLanes to_lanes(const ObservationRegister& numbers) {
  ObservationLanes lanes;
  std::memcpy(lanes.data(), &numbers, sizeof numbers);
  return lanes;
}
[[gnu::always_inline]] inline ObservationRegister to_register(const ObservationLanes& lanes) {
  ObservationRegister numbers;
  std::memcpy(&numbers, lanes.data(), sizeof numbers);
  return numbers;
}

/// The same number of four observations. They meet in a register: what is stored one by one and then loaded
/// together would have to reach the cache first.
template <class Number>
[[gnu::always_inline]] inline ObservationRegister gather(
    const MotionObservation* const (&o)[kObservationLanes], const Number& number) {
  static_assert(kObservationLanes == 4);
  return ObservationRegister{number(*o[0]), number(*o[1]), number(*o[2]), number(*o[3])};
}

/// A point behind the camera adds the cost of a far outlier and pulls at nothing: it can neither veto a step
/// nor be bought by one.
inline constexpr double kSigmasBehind = 100;

/// kObservationLanes observations side by side.
struct ObservationBatch {
  ObservationLanes x, y, z;     // point in the reference frame
  ObservationLanes u, v, r;     // measurement; r is 0 unless it counts (weighs_right)
  ObservationLanes wu, wv, wr;  // information
  ObservationLanes used;        // 1 or 0

  [[gnu::always_inline]] ObservationBatch(std::span<const MotionObservation> all, std::size_t first,
                                          bool inliers_only) {
    const MotionObservation* o[kObservationLanes];
    const std::size_t last = all.size() - 1;
    for (std::size_t lane = 0; lane < kObservationLanes; ++lane) o[lane] = &all[std::min(first + lane, last)];
    x = to_lanes(gather(o, [](const auto& m) { return m.x_ref.x(); }));
    y = to_lanes(gather(o, [](const auto& m) { return m.x_ref.y(); }));
    z = to_lanes(gather(o, [](const auto& m) { return m.x_ref.z(); }));
    u = to_lanes(gather(o, [](const auto& m) -> double { return m.pixel.x(); }));
    v = to_lanes(gather(o, [](const auto& m) -> double { return m.pixel.y(); }));
    const ObservationRegister right = gather(o, [](const auto& m) -> double { return m.pixel.z(); });
    wu = to_lanes(gather(o, [](const auto& m) -> double { return m.information.x(); }));
    wv = to_lanes(gather(o, [](const auto& m) -> double { return m.information.y(); }));
    const ObservationRegister of_right = gather(o, [](const auto& m) -> double { return m.information.z(); });
    r = to_lanes(of_right == 0 ? ObservationRegister{} : right);
    wr = to_lanes(of_right);
    const ObservationRegister wanted =
        gather(o, [&](const auto& m) -> double { return int{m.inlier} | int{!inliers_only}; });
    const auto count = static_cast<double>(all.size() - first);
    used = to_lanes(ObservationRegister{0, 1, 2, 3} < count ? wanted : ObservationRegister{});
  }
};

/// ObservationBatch as seen from the pose under test.
struct BatchProjection {
  ObservationLanes x, y, z, inv_z;  // in the camera; z is 1 where the point is behind
  ObservationLanes eu, ev, er;      // predicted minus measured
  ObservationLanes chi2;
  ObservationLanes front;  // 1 or 0

  [[gnu::always_inline]] BatchProjection(const ObservationModel& m, const Matrix3& R, const Vector3& t,
                                         const ObservationBatch& b) {
    x = R(0, 0) * b.x + R(0, 1) * b.y + R(0, 2) * b.z + t.x();
    y = R(1, 0) * b.x + R(1, 1) * b.y + R(1, 2) * b.z + t.y();
    z = R(2, 0) * b.x + R(2, 1) * b.y + R(2, 2) * b.z + t.z();
    const ObservationRegister depth = to_register(z), one = ObservationRegister{} + 1;
    front = to_lanes(depth > kSolverMinDepth ? one : ObservationRegister{});
    z = to_lanes(depth > kSolverMinDepth ? depth : one);
    inv_z = z.inverse();
    eu = m.fx * x * inv_z + (m.cx - b.u);
    ev = m.fy * y * inv_z + (m.cy - b.v);
    er = m.fx * (x - m.baseline) * inv_z + (m.cx - b.r);
    chi2 = b.wu * eu.square() + b.wv * ev.square() + b.wr * er.square();
  }
};

/// Normal equations of the left perturbation, J = d z_hat / d x [I, -[x]x]  (thesis B.21), lane by lane:
/// with S = J_x^T W J_x and f = J_x^T W e they are [S, -S X; -(S X)^T, -X S X] and (f, x x f), X = [x]x.
struct MotionEquations {
  ObservationLanes h[21];  // lower triangle, column by column
  ObservationLanes g[6];
  ObservationLanes cost = ObservationLanes::Zero();
  double used = 0;

  MotionEquations() {
    for (ObservationLanes& value : h) value.setZero();
    for (ObservationLanes& value : g) value.setZero();
  }

  [[gnu::always_inline]] void add(const ObservationModel& m, const ObservationBatch& b,
                                  const BatchProjection& p, const HuberKernel& kernel) {
    const ObservationLanes norm = p.chi2.sqrt();
    const ObservationLanes behind =
        kernel.rho_of_norms(ObservationLanes(ObservationLanes::Constant(kSigmasBehind)));
    cost += b.used * (p.front * kernel.rho_of_norms(norm) + (1 - p.front) * behind);
    const ObservationLanes weight = b.used * p.front * kernel.weights_of_norms(norm);

    const ObservationLanes a = m.fx * p.inv_z, c = m.fy * p.inv_z;
    const ObservationLanes u = p.x * p.inv_z, v = p.y * p.inv_z, r = (p.x - m.baseline) * p.inv_z;
    const ObservationLanes wu = weight * b.wu * a, wv = weight * b.wv * c, wr = weight * b.wr * a;
    const ObservationLanes fu = wu * p.eu, fv = wv * p.ev, fr = wr * p.er;
    add_gradient(p, fu + fr, fv, -(u * fu + v * fv + r * fr));

    const ObservationLanes auu = wu * a, cvv = wv * c, arr = wr * a;
    const ObservationLanes s02 = -(auu * u + arr * r), s12 = -cvv * v;
    add_hessian(p, auu + arr, s02, cvv, s12, auu * u * u + cvv * v * v + arr * r * r);
  }

  [[gnu::always_inline]] void add_gradient(const BatchProjection& p, const ObservationLanes& f0,
                                           const ObservationLanes& f1, const ObservationLanes& f2) {
    g[0] += f0, g[1] += f1, g[2] += f2;
    g[3] += p.y * f2 - p.z * f1;
    g[4] += p.z * f0 - p.x * f2;
    g[5] += p.x * f1 - p.y * f0;
  }

  [[gnu::always_inline]] void add_hessian(const BatchProjection& p, const ObservationLanes& s00,
                                          const ObservationLanes& s02, const ObservationLanes& s11,
                                          const ObservationLanes& s12, const ObservationLanes& s22) {
    // Rows of the lower left block (-S X)^T = X S: columns of S crossed from the left by x (s01 = 0).
    const ObservationLanes m00 = p.y * s02, m01 = p.y * s12 - p.z * s11, m02 = p.y * s22 - p.z * s12;
    const ObservationLanes m10 = p.z * s00 - p.x * s02, m11 = -p.x * s12, m12 = p.z * s02 - p.x * s22;
    const ObservationLanes m20 = -p.y * s00, m21 = p.x * s11, m22 = p.x * s12 - p.y * s02;
    h[0] += s00, h[2] += s02, h[3] += m00, h[4] += m10, h[5] += m20;
    h[6] += s11, h[7] += s12, h[8] += m01, h[9] += m11, h[10] += m21;
    h[11] += s22, h[12] += m02, h[13] += m12, h[14] += m22;
    // Lower right block: rows of M crossed by x, -M X.
    h[15] += p.y * m02 - p.z * m01;
    h[16] += p.y * m12 - p.z * m11;
    h[17] += p.y * m22 - p.z * m21;
    h[18] += p.z * m10 - p.x * m12;
    h[19] += p.z * m20 - p.x * m22;
    h[20] += p.x * m21 - p.y * m20;
  }

  [[nodiscard]] Matrix6 hessian() const {
    Matrix6 H;
    for (int col = 0, n = 0; col < 6; ++col) {
      for (int row = col; row < 6; ++row, ++n) H(row, col) = H(col, row) = h[n].sum();
    }
    return H;
  }
  [[nodiscard]] Vector6 gradient() const {
    Vector6 result;
    for (int row = 0; row < 6; ++row) result[row] = g[row].sum();
    return result;
  }
};

}  // namespace twofold
