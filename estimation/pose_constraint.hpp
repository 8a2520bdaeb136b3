#pragma once

#include "geometry/se3.hpp"

namespace twofold {

/// Relative pose error v_ji = log(T_ji T_i T_j^-1) of two poses that map world points into their cameras
/// (thesis B.6). Its Jacobians by left perturbations T <- exp(delta) T are
///   dv / d delta_i = J(v) Ad(T_ji),      dv / d delta_j = -J(-v)
/// with J below; the thesis approximates them by the second-order CBH expansion.
[[nodiscard]] Vector6 pose_constraint_error(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w);

/// J(v) = d log(exp(x) exp(v)) / d x at x = 0: inverse of the left Jacobian of SE(3) at v, rotation angle
/// below 2 pi.
[[nodiscard]] Matrix6 se3_left_jacobian_inverse(const Vector6& v);

}  // namespace twofold
