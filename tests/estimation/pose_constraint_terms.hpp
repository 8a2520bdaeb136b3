#pragma once

#include "estimation/pose_constraint.hpp"

namespace twofold {

/// A relative pose error with its Jacobians, as estimation/pose_constraint.hpp states them.
struct PoseConstraintTerms {
  Vector6 v;
  Matrix6 J_i;
  Matrix6 J_j;
};

inline PoseConstraintTerms linearise_pose_constraint(const SE3& T_j_i, const SE3& T_i_w, const SE3& T_j_w) {
  const Vector6 v = pose_constraint_error(T_j_i, T_i_w, T_j_w);
  return {v, se3_left_jacobian_inverse(v) * T_j_i.adjoint(), -se3_left_jacobian_inverse(-v)};
}

}  // namespace twofold
