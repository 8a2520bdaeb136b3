#pragma once

#include "geometry/so3.hpp"

namespace twofold {

/// Rigid motion of three-dimensional space: x -> R x + t  [m].
///
/// T_a_b maps points of frame b into frame a. Tangent order (v, w); perturbations act on the left:
/// T <- exp(delta) * T  (thesis 2.4.10).
class SE3 {
 public:
  static constexpr int kDof = 6;
  using Tangent = Vector6;
  using AdjointMatrix = Matrix6;

  SE3() : t_(Vector3::Zero()) {}
  SE3(const SO3& R, const Vector3& t) : R_(R), t_(t) {}
  SE3(const Matrix3& R, const Vector3& t) : R_(R), t_(t) {}

  /// Closed form  (thesis eq. 2.70 - 2.72).
  [[nodiscard]] static SE3 exp(const Vector6& v_w);
  /// Inverse of exp with rotation angle in [0, pi].
  [[nodiscard]] Vector6 log() const;

  [[nodiscard]] const SO3& so3() const { return R_; }
  [[nodiscard]] Matrix3 rotation() const { return R_.matrix(); }
  [[nodiscard]] const Vector3& translation() const { return t_; }
  [[nodiscard]] Vector3& translation() { return t_; }
  [[nodiscard]] Matrix4 matrix() const;
  [[nodiscard]] SE3 inverse() const;
  /// Ad_T with T exp(x) T^-1 = exp(Ad_T x)  (thesis A.2.1).
  [[nodiscard]] Matrix6 adjoint() const;
  [[nodiscard]] Vector3 operator*(const Vector3& x) const { return R_ * x + t_; }
  [[nodiscard]] SE3 operator*(const SE3& other) const { return {R_ * other.R_, R_ * other.t_ + t_}; }

 private:
  SO3 R_;
  Vector3 t_;
};

}  // namespace twofold
