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
  kRadTan,        ///< radial-tangential (Brown-Conrady): k1, k2, p1, p2, k3, OpenCV's order
  kEquidistant,   ///< Kannala-Brandt fisheye: k1, k2, k3, k4
  kDoubleSphere,  ///< Usenko et al., 3DV 2018: xi, alpha; restricted to rays with z > 0
  /// k1, k2, p1, p2, k3, k4, k5, k6: OpenCV's CALIB_RATIONAL_MODEL, ROS' rational_polynomial. kRadTan with a
  /// quotient along the radius: x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + ...
  kRational
};

/// Lens distortion: maps ideal to distorted image coordinates, both on the plane z = 1 (no unit).
struct Distortion {
  using Coefficients = std::array<double, 8>;

  DistortionModel model = DistortionModel::kNone;
  Coefficients coefficients{};  ///< in the model's order above; unused ones are ignored

  /// Number of coefficients `model` uses.
  [[nodiscard]] int coefficient_count() const;
  [[nodiscard]] bool is_identity() const;
  /// Empty when valid; otherwise names the coefficient, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;

  /// Distorted coordinates of the ideal point xy = (x/z, y/z).
  /// @param J  if not null, d result / d xy
  [[nodiscard]] Vector2 distort(const Vector2& xy, Eigen::Matrix2d* J = nullptr) const;

  /// Whether the radial part of the image, tangential terms left out, grows with the radius all the way from
  /// the optical axis to xy. Beyond a fold or, where kRational divides by zero, a pole distort still gives
  /// pixels, but no lens sees xy there. kDoubleSphere always does.
  [[nodiscard]] bool reaches(const Vector2& xy) const;

  /// Inverse of distort by damped Newton iterations.
  ///
  /// @param xy_d  distorted coordinates on the plane z = 1
  /// @return  ideal point; nullopt when xy_d lies outside of the image of that part of the plane on which
  ///          the model is one-to-one around the optical axis: beyond it the polynomial folds back, or the
  ///          quotient has a pole, and there is no meaningful inverse.
  [[nodiscard]] std::optional<Vector2> undistort(const Vector2& xy_d) const;
};

}  // namespace twofold
