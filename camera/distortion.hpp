#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "geometry/types.hpp"

namespace twofold {

enum class DistortionModel : std::uint8_t {
  kNone,
  kRadTan,       ///< radial-tangential (Brown-Conrady): k1, k2, p1, p2, k3, OpenCV's order
  kEquidistant,  ///< Kannala-Brandt fisheye: k1, k2, k3, k4
  kDoubleSphere  ///< Usenko et al., 3DV 2018: xi, alpha; restricted to rays with z > 0
};

/// Lens distortion: maps ideal to distorted image coordinates, both on the plane z = 1 (no unit).
struct Distortion {
  DistortionModel model = DistortionModel::kNone;
  std::array<double, 5> coefficients{};  ///< in the model's order above; unused ones are ignored

  /// Number of coefficients `model` uses.
  [[nodiscard]] int coefficient_count() const;
  [[nodiscard]] bool is_identity() const;
  /// Empty when valid; otherwise names the coefficient, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;

  /// Distorted coordinates of the ideal point xy = (x/z, y/z).
  /// @param J  if not null, d result / d xy
  [[nodiscard]] Vector2 distort(const Vector2& xy, Eigen::Matrix2d* J = nullptr) const;

  /// Inverse of distort by damped Newton iterations.
  ///
  /// @param xy_d  distorted coordinates on the plane z = 1
  /// @return  ideal point; nullopt when xy_d lies outside of the image of that part of the plane on which
  ///          the model is one-to-one around the optical axis: beyond it the polynomial folds back and has
  ///          no meaningful inverse.
  [[nodiscard]] std::optional<Vector2> undistort(const Vector2& xy_d) const;
};

}  // namespace twofold
