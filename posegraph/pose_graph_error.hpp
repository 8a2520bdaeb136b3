#pragma once

#include "posegraph/pose_graph.hpp"

namespace twofold {

/// The error's component form and its derivative; see PoseGraphError.
[[nodiscard]] inline Vector3 component_error(const SE2& E) {
  return {E.translation().x(), E.translation().y(), E.angle()};
}
[[nodiscard]] inline Vector6 component_error(const SE3& E) {
  const Eigen::Quaterniond& q = E.so3().quaternion();
  Vector6 e;
  e << E.translation(), (q.w() < 0 ? -2.0 : 2.0) * q.vec();
  return e;
}
[[nodiscard]] inline Vector7 component_error(const Sim3& E) {
  const Eigen::Quaterniond& q = E.so3().quaternion();
  Vector7 e;
  e << E.translation(), (q.w() < 0 ? -2.0 : 2.0) * q.vec(), std::log(E.scale());
  return e;
}

/// d component_error(exp(y) E) / d y at y = 0. The quaternion moves by (0, w/2) q: its doubled vector part by
/// q_w w + w x q_v.
[[nodiscard]] inline Matrix3 component_jacobian(const SE2& E) {
  Matrix3 J;
  J << 1, 0, -E.translation().y(), 0, 1, E.translation().x(), 0, 0, 1;
  return J;
}
[[nodiscard]] inline Matrix6 component_jacobian(const SE3& E) {
  const Eigen::Quaterniond& q = E.so3().quaternion();
  const double sign = q.w() < 0 ? -1 : 1;
  Matrix6 J;
  J << Matrix3::Identity(), -hat(E.translation()), Matrix3::Zero(),
      sign * (q.w() * Matrix3::Identity() - hat(q.vec()));
  return J;
}
[[nodiscard]] inline Matrix7 component_jacobian(const Sim3& E) {
  Matrix7 J = Matrix7::Zero();
  J.topLeftCorner<6, 6>() = component_jacobian(SE3(E.so3(), E.translation()));
  J.topRightCorner<3, 1>() = E.translation();
  J(6, 6) = 1;
  return J;
}

template <class Group>
[[nodiscard]] typename Group::Tangent pose_graph_error(const Group& E, PoseGraphError error) {
  return error == PoseGraphError::kLog ? typename Group::Tangent(E.log()) : component_error(E);
}

/// d e(exp(y) E) / d y at y = 0, e = pose_graph_error(E).
template <class Group>
[[nodiscard]] typename Group::AdjointMatrix pose_graph_error_jacobian(const Group& E,
                                                                      const typename Group::Tangent& e,
                                                                      PoseGraphError error, CbhOrder order) {
  return error == PoseGraphError::kLog ? cbh_jacobian<Group>(e, order) : component_jacobian(E);
}

}  // namespace twofold
