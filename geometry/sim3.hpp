#pragma once

#include "geometry/se3.hpp"

namespace twofold {

/// Similarity of three-dimensional space: x -> s R x + t, s > 0  (thesis 5.2).
///
/// Tangent order (v, w, sigma) with sigma = ln s; perturbations act on the left: S <- exp(delta) * S.
class Sim3 {
 public:
  static constexpr int kDof = 7;
  using Tangent = Vector7;
  using AdjointMatrix = Matrix7;

  Sim3() : s_(1.0), t_(Vector3::Zero()) {}
  /// s must be positive.
  Sim3(double s, const SO3& R, const Vector3& t) : s_(s), R_(R), t_(t) {}
  /// Scale one.
  explicit Sim3(const SE3& T) : s_(1.0), R_(T.so3()), t_(T.translation()) {}

  /// Closed form  (thesis eq. 5.6, 5.7), with full accuracy also for sigma -> 0 and |w| -> 0.
  [[nodiscard]] static Sim3 exp(const Vector7& v_w_sigma);
  /// Inverse of exp with rotation angle in [0, pi]  (eq. 5.8).
  [[nodiscard]] Vector7 log() const;

  [[nodiscard]] double scale() const { return s_; }
  [[nodiscard]] const SO3& so3() const { return R_; }
  [[nodiscard]] Matrix3 rotation() const { return R_.matrix(); }
  [[nodiscard]] const Vector3& translation() const { return t_; }
  [[nodiscard]] Vector3& translation() { return t_; }
  [[nodiscard]] Matrix4 matrix() const;
  [[nodiscard]] Sim3 inverse() const;
  /// Ad_S with S exp(x) S^-1 = exp(Ad_S x)  (A.6; the first matrix of A.7 has the sign of t wrong).
  [[nodiscard]] Matrix7 adjoint() const;
  [[nodiscard]] Vector3 operator*(const Vector3& x) const { return s_ * (R_ * x) + t_; }
  [[nodiscard]] Sim3 operator*(const Sim3& other) const {
    return {s_ * other.s_, R_ * other.R_, s_ * (R_ * other.t_) + t_};
  }

  /// Rigid motion with the same camera centre and viewing direction, for S that maps world points into a
  /// camera: s R x + t = s (R x + t / s), and a camera does not see the factor s. (The end of thesis 5.3.2
  /// says "s t", which holds for its inverse convention of s only.)
  [[nodiscard]] SE3 without_scale() const { return {R_, t_ / s_}; }

 private:
  double s_;
  SO3 R_;
  Vector3 t_;
};

}  // namespace twofold
