#include "filters/process_model.hpp"

#include <Eigen/LU>

#include "geometry/cbh.hpp"

namespace twofold {

Matrix6 MotionInput::information() const {
  return covariance.inverse();
}

MotionError motion_error(const MotionInput& input, const SE3& T_prev_w, const SE3& T_cur_w) {
  const SE3 T_cur_prev = T_cur_w * T_prev_w.inverse();
  MotionError error;
  error.e = (T_cur_prev * input.T_cur_prev.inverse()).log();
  error.J_cur = cbh_jacobian<SE3>(error.e, CbhOrder::kExact);
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
