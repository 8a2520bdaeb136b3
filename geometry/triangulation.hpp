#pragma once

#include <cstdint>
#include <span>
#include <tl/expected.hpp>

#include "geometry/se3.hpp"

namespace twofold {

enum class TriangulationError : std::uint8_t { kLowParallax, kBehindCamera, kNotConverged };

/// Mid-point triangulation of one landmark from two calibrated views.
///
/// @param bearing_a, bearing_b  unit rays, each in its own camera frame
/// @param T_a_b                 pose of b in a [m]:  p_a = T_a_b * p_b
/// @param min_parallax          smallest accepted angle between the rays [rad], > 0
/// @return  landmark in frame a [m]
///          kLowParallax   angle between the rays < min_parallax
///          kBehindCamera  the rays come closest behind either camera
///
/// Minimises the summed squared distance to both rays in closed form; Hartley & Sturm, CVIU 1997.
[[nodiscard]] tl::expected<Vector3, TriangulationError> triangulate_midpoint(const Vector3& bearing_a,
                                                                             const Vector3& bearing_b,
                                                                             const SE3& T_a_b,
                                                                             double min_parallax);

/// One sighting of a landmark for refine_inverse_depth.
struct InverseDepthView {
  SE3 T_c_a;   ///< maps the anchor frame into the observing camera [m]
  Vector2 xy;  ///< where it was seen, on the plane z = 1
};

/// Inverse depth coordinates of a landmark from any number of views, anchored as in thesis 3.4.4.
///
/// Gauss-Newton with step halving on the squared distances on the plane z = 1, from `psi_start`.
/// @param psi_start  (x/z, y/z, 1/z) in the anchor frame
/// @return  refined coordinates
///          kBehindCamera  psi_start or the result lies behind a view
///          kLowParallax   the normal equations are singular: the views do not fix the depth
///          kNotConverged  still moving after max_iterations
[[nodiscard]] tl::expected<Vector3, TriangulationError> refine_inverse_depth(
    const Vector3& psi_start, std::span<const InverseDepthView> views, int max_iterations = 20);

}  // namespace twofold
