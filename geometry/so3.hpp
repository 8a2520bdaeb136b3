#pragma once

#include <Eigen/Geometry>

#include "geometry/types.hpp"

namespace twofold {

/// [w]x with [w]x v = w x v  (thesis eq. 2.45).
[[nodiscard]] inline Matrix3 hat(const Vector3& w) {
  Matrix3 m;
  m << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  return m;
}

/// Rotation in three dimensions, stored as a unit quaternion.
///
/// Perturbations act on the left: R <- exp(w) * R, w in radians. All maps are accurate for angles near 0 and
/// near pi.
class SO3 {
 public:
  static constexpr int kDof = 3;
  using Tangent = Vector3;
  using AdjointMatrix = Matrix3;

  SO3() : q_(Eigen::Quaterniond::Identity()) {}
  /// q need not be normalised; must not be zero.
  explicit SO3(const Eigen::Quaterniond& q) : q_(q.normalized()) {}
  /// R must be a rotation up to rounding; it is re-orthonormalised through the quaternion.
  explicit SO3(const Matrix3& R) : q_(Eigen::Quaterniond(R).normalized()) {}

  /// Rodrigues' formula in quaternion form  (thesis eq. 2.60).
  [[nodiscard]] static SO3 exp(const Vector3& w);
  /// Rotation vector with norm in [0, pi]  (thesis eq. 2.63).
  [[nodiscard]] Vector3 log() const;

  [[nodiscard]] const Eigen::Quaterniond& quaternion() const { return q_; }
  [[nodiscard]] Matrix3 matrix() const { return q_.toRotationMatrix(); }
  [[nodiscard]] SO3 inverse() const { return unchecked(q_.conjugate()); }
  /// Ad_R = R.
  [[nodiscard]] Matrix3 adjoint() const { return matrix(); }
  [[nodiscard]] Vector3 operator*(const Vector3& x) const { return q_ * x; }
  [[nodiscard]] SO3 operator*(const SO3& other) const;

 private:
  static SO3 unchecked(const Eigen::Quaterniond& q) {
    SO3 r;
    r.q_ = q;
    return r;
  }
  Eigen::Quaterniond q_;
};

}  // namespace twofold
