#pragma once

#include "geometry/se3.hpp"

namespace twofold {

/// Relative pose error v_ji = log(T_ji T_i T_j^-1) and its Jacobians by left perturbations of T_i and T_j
/// (thesis B.6, there approximated by the second-order CBH expansion, here exact).
struct PoseConstraintTerms {
  Vector6 v;
  Matrix6 J_i;
  Matrix6 J_j;
};

[[nodiscard]] Vector6 pose_constraint_error(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w);
[[nodiscard]] PoseConstraintTerms linearise_pose_constraint(const SE3& T_j_i, const SE3& T_i_w,
                                                            const SE3& T_j_w);

/// d log(exp(x) exp(v)) / d x at x = 0: inverse of the left Jacobian of SE(3) at v, rotation angle below
/// 2 pi.
[[nodiscard]] Matrix6 se3_left_jacobian_inverse(const Vector6& v);

}  // namespace twofold
