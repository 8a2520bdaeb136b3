#pragma once

#include <optional>

#include "geometry/types.hpp"

namespace twofold {

/// Depth over how far aside, of the flattest ray that is looked for: no image is 2000 focal lengths wide.
inline constexpr double kFlattestRay = 1e-3;

/// Whether a point in the camera frame can be looked for in an image: one behind the camera has no
/// projection, and none that a pinhole camera sees lies straight to its side. How far away it is does not
/// count, because one camera's unit is arbitrary: who starts high above the ground lands at a thousandth of
/// it. So x_c may have any length, as inverse depth coordinates give it, h = q x_c.
[[nodiscard]] inline bool in_front_of_camera(const Vector3& x_c) {
  return x_c.z() > kFlattestRay * x_c.head<2>().lpNorm<Eigen::Infinity>();
}

/// Pinhole camera without distortion  (thesis eq. 3.3, with fx != fy allowed).
///
/// Pixels (u, v); (0, 0) is the centre of the top-left pixel. Camera axes: x right, y down, z forward.
struct PinholeCamera {
  double fx = 0;   ///< [px] > 0
  double fy = 0;   ///< [px] > 0
  double cx = 0;   ///< [px]
  double cy = 0;   ///< [px]
  int width = 0;   ///< [px] > 0
  int height = 0;  ///< [px] > 0

  /// Pixel of a point in the camera frame [m]; x_c.z() must be positive.
  [[nodiscard]] Vector2 project(const Vector3& x_c) const {
    const double inv_z = 1.0 / x_c.z();
    return {fx * x_c.x() * inv_z + cx, fy * x_c.y() * inv_z + cy};
  }
  /// d project / d x_c  (thesis B.1).
  [[nodiscard]] Matrix23 project_jacobian(const Vector3& x_c) const {
    const double inv_z = 1.0 / x_c.z();
    Matrix23 J;
    J << fx * inv_z, 0, -fx * x_c.x() * inv_z * inv_z, 0, fy * inv_z, -fy * x_c.y() * inv_z * inv_z;
    return J;
  }
  /// Point of the ray through uv at depth 1 [m].
  [[nodiscard]] Vector3 unproject(const Vector2& uv) const {
    return {(uv.x() - cx) / fx, (uv.y() - cy) / fy, 1.0};
  }
  /// uv at least `border` pixels away from the image's edge.
  [[nodiscard]] bool contains(const Vector2& uv, double border = 0) const {
    return uv.x() >= border && uv.y() >= border && uv.x() <= width - 1 - border &&
           uv.y() <= height - 1 - border;
  }
  /// Pixel of a point in the camera frame, if it is in view: in front, and `border` pixels inside the image.
  [[nodiscard]] std::optional<Vector2> find_in_view(const Vector3& x_c, double border = 0) const {
    if (!in_front_of_camera(x_c)) return std::nullopt;
    const Vector2 uv = project(x_c);
    if (!contains(uv, border)) return std::nullopt;
    return uv;
  }
  /// Camera of pyramid level `level`: level pixel p covers level-0 pixels (p + 0.5) 2^level - 0.5 around its
  /// centre.
  [[nodiscard]] PinholeCamera at_level(int level) const;
};

}  // namespace twofold
