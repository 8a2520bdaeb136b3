#include "geometry/triangulation.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "geometry/inverse_depth.hpp"

namespace twofold {

tl::expected<Vector3, TriangulationError> triangulate_midpoint(const Vector3& bearing_a,
                                                               const Vector3& bearing_b, const SE3& T_a_b,
                                                               double min_parallax) {
  const Vector3 b_a = T_a_b.so3() * bearing_b;
  const double c = bearing_a.dot(b_a);
  const double s2 =
      bearing_a.cross(b_a).squaredNorm();  // sin^2 of the parallax, accurate where 1 - c^2 is not
  if (std::atan2(std::sqrt(s2), c) < min_parallax || s2 == 0) {
    return tl::unexpected(TriangulationError::kLowParallax);
  }
  // Feet of the common perpendicular: depth_a * bearing_a and t + depth_b * b_a.
  const Vector3& t = T_a_b.translation();
  const double ta = t.dot(bearing_a);
  const double tb = t.dot(b_a);
  const double depth_a = (ta - c * tb) / s2;
  const double depth_b = (c * ta - tb) / s2;
  if (depth_a <= 0 || depth_b <= 0) return tl::unexpected(TriangulationError::kBehindCamera);
  return Vector3(0.5 * (depth_a * bearing_a + t + depth_b * b_a));
}

namespace {

/// Half the squared error of psi; infinite when the point is not in front of every view.
double reprojection_cost(const Vector3& psi, std::span<const InverseDepthView> views) {
  if (!(psi.z() > 0)) return std::numeric_limits<double>::infinity();
  const Vector3 x_a = from_inverse_depth(psi);
  double cost = 0;
  for (const InverseDepthView& view : views) {
    const Vector3 x_c = view.T_c_a * x_a;
    if (x_c.z() <= 0) return std::numeric_limits<double>::infinity();
    cost += 0.5 * (view.xy - x_c.head<2>() / x_c.z()).squaredNorm();
  }
  return cost;
}

void normal_equations(const Vector3& psi, std::span<const InverseDepthView> views, Matrix3& H, Vector3& g) {
  H.setZero();
  g.setZero();
  for (const InverseDepthView& view : views) {
    const Vector3 x_c = view.T_c_a * from_inverse_depth(psi);
    const double inv_z = 1 / x_c.z();
    const Vector2 xy = x_c.head<2>() * inv_z;
    Matrix23 J_proj;  // B.2
    J_proj << inv_z, 0, -xy.x() * inv_z, 0, inv_z, -xy.y() * inv_z;
    const Matrix23 J = J_proj * inverse_depth_jacobian(view.T_c_a.rotation(), psi);
    H += J.transpose() * J;
    g += J.transpose() * (view.xy - xy);
  }
}

}  // namespace

tl::expected<Vector3, TriangulationError> refine_inverse_depth(const Vector3& psi_start,
                                                               std::span<const InverseDepthView> views,
                                                               int max_iterations) {
  constexpr double kSingular = 1e-12;  // smallest pivot ratio that still carries information
  Vector3 psi = psi_start;
  double cost = reprojection_cost(psi, views);
  if (!std::isfinite(cost)) return tl::unexpected(TriangulationError::kBehindCamera);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Matrix3 H;
    Vector3 g;
    normal_equations(psi, views, H, g);
    const Eigen::LDLT<Matrix3> ldlt(H);
    const Vector3 pivots = ldlt.vectorD();
    if (!(pivots.minCoeff() > kSingular * pivots.maxCoeff())) {
      return tl::unexpected(TriangulationError::kLowParallax);
    }
    Vector3 step = ldlt.solve(g);
    double cost_new = reprojection_cost(psi + step, views);
    for (int halving = 0; cost_new > cost && halving < 10; ++halving) {
      step *= 0.5;
      cost_new = reprojection_cost(psi + step, views);
    }
    if (cost_new > cost) return psi;  // no direction improves: at the minimum up to rounding
    psi += step;
    cost = cost_new;
    if (step.norm() < 1e-10 * (1 + psi.norm())) return psi;
  }
  return tl::unexpected(TriangulationError::kNotConverged);
}

}  // namespace twofold
