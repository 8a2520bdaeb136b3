#pragma once

#include "geometry/so3.hpp"

namespace twofold {

using Matrix37 = Eigen::Matrix<double, 3, 7>;

/// d (exp(e) * y) / d e at e = 0 in SE(3), with y the transformed point: [I, -[y]x]  (thesis B.12).
[[nodiscard]] inline Matrix36 se3_point_jacobian(const Vector3& y) {
  Matrix36 J;
  J << Matrix3::Identity(), -hat(y);
  return J;
}

/// The same in Sim(3): [I, -[y]x, y]  (B.14).
[[nodiscard]] inline Matrix37 sim3_point_jacobian(const Vector3& y) {
  Matrix37 J;
  J << Matrix3::Identity(), -hat(y), y;
  return J;
}

}  // namespace twofold
