#include "geometry/triangulation.hpp"

#include <cmath>

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

}  // namespace twofold
