#pragma once

#include <cstdint>
#include <tl/expected.hpp>

#include "geometry/se3.hpp"

namespace twofold {

enum class TriangulationError : std::uint8_t { kLowParallax, kBehindCamera };

/// Mid-point triangulation of one point from two calibrated views.
///
/// @param bearing_a, bearing_b  unit rays, each in its own camera frame
/// @param T_a_b                 pose of b in a [m]:  p_a = T_a_b * p_b
/// @param min_parallax          smallest accepted angle between the rays [rad], > 0
/// @return  the point in frame a [m]
///          kLowParallax   angle between the rays < min_parallax
///          kBehindCamera  the rays come closest behind either camera
///
/// Minimises the summed squared distance to both rays in closed form; Hartley & Sturm, CVIU 1997.
[[nodiscard]] tl::expected<Vector3, TriangulationError> triangulate_midpoint(const Vector3& bearing_a,
                                                                             const Vector3& bearing_b,
                                                                             const SE3& T_a_b,
                                                                             double min_parallax);

}  // namespace twofold
