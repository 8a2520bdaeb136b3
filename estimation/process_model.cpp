#include "estimation/process_model.hpp"

#include <Eigen/LU>

namespace twofold {
namespace {

/// ad(xi) with ad(a) b = [a, b], tangent order (v, omega).
Matrix6 little_adjoint(const Vector6& xi) {
  const Matrix3 W = hat(xi.tail<3>());
  Matrix6 ad;
  ad << W, hat(xi.head<3>()), Matrix3::Zero(), W;
  return ad;
}

}  // namespace

Matrix6 se3_left_jacobian_inverse(const Vector6& xi) {
  // J_l = sum ad^n / (n + 1)! converges everywhere and needs no case distinction at zero; 6 x 6 inverts at
  // once.
  const Matrix6 ad = little_adjoint(xi);
  Matrix6 J_l = Matrix6::Identity();
  Matrix6 term = Matrix6::Identity();
  for (int n = 1; n <= 60; ++n) {
    term = term * ad / (n + 1.0);
    J_l += term;
    if (term.cwiseAbs().maxCoeff() < 1e-18) break;
  }
  return J_l.inverse();
}

MotionError motion_error(const MotionInput& input, const SE3& T_prev_w, const SE3& T_cur_w) {
  const SE3 T_cur_prev = T_cur_w * T_prev_w.inverse();
  MotionError error;
  error.e = (T_cur_prev * input.T_cur_prev.inverse()).log();
  error.J_cur = se3_left_jacobian_inverse(error.e);
  // exp(-d) on the right of T_cur_prev equals exp(-Ad d) on its left.
  error.J_prev = -error.J_cur * T_cur_prev.adjoint();
  return error;
}

MotionInput motion_from_velocity(const Vector3& v_b, const Vector3& omega_b, const SE3& T_c_b,
                                 const Vector6& variance, double dt) {
  Vector6 twist_b;
  twist_b << v_b, omega_b;
  const Matrix6 ad = T_c_b.adjoint();
  MotionInput input;
  input.T_cur_prev = SE3::exp(ad * (-dt * twist_b));
  input.covariance = dt * dt * ad * variance.asDiagonal() * ad.transpose();
  return input;
}

}  // namespace twofold
