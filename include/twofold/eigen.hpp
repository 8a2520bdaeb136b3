#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "twofold/estimate.hpp"

namespace twofold {

/// The 4x4 matrix of T_a_b.
[[nodiscard]] inline Eigen::Isometry3d to_eigen(const Pose& T_a_b) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(T_a_b.q[3], T_a_b.q[0], T_a_b.q[1], T_a_b.q[2]).toRotationMatrix();
  T.translation() = Eigen::Vector3d(T_a_b.t[0], T_a_b.t[1], T_a_b.t[2]);
  return T;
}

/// The linear part must be a rotation.
[[nodiscard]] inline Pose from_eigen(const Eigen::Isometry3d& T_a_b) {
  const Eigen::Quaterniond q(T_a_b.linear());
  const auto& t = T_a_b.translation();
  return {{q.x(), q.y(), q.z(), q.w()}, {t.x(), t.y(), t.z()}};
}

/// PoseEstimate::covariance, symmetric: rows and columns in the order (translation, rotation).
[[nodiscard]] inline Eigen::Matrix<double, 6, 6> covariance(const PoseEstimate& estimate) {
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(estimate.covariance.data());
}

}  // namespace twofold
