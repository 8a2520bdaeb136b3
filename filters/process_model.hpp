#pragma once

#include "geometry/se3.hpp"

namespace twofold {

/// Measured motion between two consecutive poses and its uncertainty: the process model of SWF 2.1, the
/// compound operation T_cur_w = exp(w) * T_cur_prev * T_prev_w with w ~ N(0, covariance).
struct MotionInput {
  SE3 T_cur_prev;
  Matrix6 covariance = Matrix6::Identity();   ///< of w, tangent order (v, omega) [m, rad], positive definite
  [[nodiscard]] Matrix6 information() const;  ///< covariance^-1
};

/// Error e = log(T_cur_w * T_prev_w^-1 * T_cur_prev^-1) and its derivatives by left perturbations of the
/// poses: the block row of D in SWF eq. 5.
struct MotionError {
  Vector6 e = Vector6::Zero();
  Matrix6 J_prev = Matrix6::Zero();
  Matrix6 J_cur = Matrix6::Zero();
};

/// f(x, u): the compound operation.
[[nodiscard]] inline SE3 compound(const MotionInput& input, const SE3& T_prev_w) {
  return input.T_cur_prev * T_prev_w;
}

[[nodiscard]] MotionError motion_error(const MotionInput& input, const SE3& T_prev_w, const SE3& T_cur_w);

/// Motion input from velocities held constant over dt.
///
/// @param v_b, omega_b  velocity of body b relative to the world, in b [m/s, rad/s]
/// @param T_c_b         body to camera; the lever arm turns rotation into camera translation
/// @param variance      of (v_b, omega_b), diagonal
/// @param dt            [s], > 0
/// The world moves backwards in the body: T_cur_prev = exp(-dt (v, omega)), carried to the camera by
/// Ad(T_c_b). The noise enters with the velocities, so its covariance is dt^2 J_l diag(variance) J_l^T, J_l
/// taken as I: the neglected term is of the order of the rotation within one step.
[[nodiscard]] MotionInput motion_from_velocity(const Vector3& v_b, const Vector3& omega_b, const SE3& T_c_b,
                                               const Vector6& variance, double dt);

}  // namespace twofold
