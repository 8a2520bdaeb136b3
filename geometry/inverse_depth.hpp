#pragma once

#include "geometry/types.hpp"

namespace twofold {

/// Inverse depth coordinates psi = (x/z, y/z, 1/z) of a point in its anchor frame  (thesis 3.4.4, B.3).

/// Pi(psi): Euclidean point [m]; psi.z() must not be zero.
[[nodiscard]] inline Vector3 from_inverse_depth(const Vector3& psi) {
  return Vector3(psi.x(), psi.y(), 1.0) / psi.z();
}

/// Inverse of Pi; x.z() must not be zero. Pi is its own inverse as a formula.
[[nodiscard]] inline Vector3 to_inverse_depth(const Vector3& x) {
  return Vector3(x.x(), x.y(), 1.0) / x.z();
}

/// Derivative of y = R_c_a * Pi(psi) + t_c_a by psi, q = psi.z():
/// [R e1, R e2, -R Pi(psi)] / q  (thesis B.3).
[[nodiscard]] inline Matrix3 inverse_depth_jacobian(const Matrix3& R_c_a, const Vector3& psi) {
  Matrix3 J;
  const double inv_q = 1.0 / psi.z();
  J.leftCols<2>() = R_c_a.leftCols<2>() * inv_q;
  J.col(2) = -(R_c_a * from_inverse_depth(psi)) * inv_q;
  return J;
}

}  // namespace twofold
