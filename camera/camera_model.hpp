#pragma once

#include <optional>
#include <string>

#include "camera/distortion.hpp"
#include "camera/pinhole.hpp"

namespace twofold {

/// Camera as the maker delivers it: lens distortion on the plane z = 1, then a pinhole camera.
struct CameraModel {
  PinholeCamera pinhole;  ///< intrinsics and size of the raw image
  Distortion distortion;

  /// Empty when valid; otherwise names the field, the rule and the value. fx and fy are of one size,
  /// and not of millimetres. The principal point lies within an image's size of the image. A rational lens
  /// must be one that sees the right, left, upper and lower end of the largest circle around the principal
  /// point that fits into the image, a radtan lens those of two fifths of it: coefficients of another lens,
  /// or in another order, fold the image over before that.
  [[nodiscard]] std::string invalid_reason() const;

  /// Raw pixel of a point in the camera frame [m]; x_c.z() must be positive.
  /// @param J  if not null, d project / d x_c
  [[nodiscard]] Vector2 project(const Vector3& x_c, Matrix23* J = nullptr) const;
  /// Point at depth 1 of the ray seen by raw pixel uv; nullopt where the distortion has no inverse.
  [[nodiscard]] std::optional<Vector3> unproject(const Vector2& uv) const;
};

}  // namespace twofold
