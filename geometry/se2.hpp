#pragma once

#include <Eigen/Core>

#include "geometry/types.hpp"

namespace twofold {

/// Rigid motion of the plane: x -> R(angle) x + t. Tangent order (v, w), perturbations on the left as for
/// SE3.
class SE2 {
 public:
  static constexpr int kDof = 3;
  using Tangent = Vector3;
  using AdjointMatrix = Matrix3;

  SE2() : t_(Vector2::Zero()) {}
  /// angle [rad], any multiple of the turn.
  SE2(double angle, const Vector2& t);

  [[nodiscard]] static SE2 exp(const Vector3& v_w);
  /// Inverse of exp with angle in [-pi, pi].
  [[nodiscard]] Vector3 log() const;

  /// In [-pi, pi].
  [[nodiscard]] double angle() const;
  [[nodiscard]] Eigen::Matrix2d rotation() const;
  [[nodiscard]] const Vector2& translation() const { return t_; }
  [[nodiscard]] Vector2& translation() { return t_; }
  [[nodiscard]] SE2 inverse() const;
  /// Ad_T with T exp(x) T^-1 = exp(Ad_T x).
  [[nodiscard]] Matrix3 adjoint() const;
  [[nodiscard]] Vector2 operator*(const Vector2& x) const {
    return {cos_ * x.x() - sin_ * x.y() + t_.x(), sin_ * x.x() + cos_ * x.y() + t_.y()};
  }
  [[nodiscard]] SE2 operator*(const SE2& other) const;

 private:
  double cos_ = 1, sin_ = 0;
  Vector2 t_;
};

}  // namespace twofold
