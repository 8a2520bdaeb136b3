#include "geometry/nearest_rotation.hpp"

#include <Eigen/SVD>

namespace twofold {

Matrix3 nearest_rotation(const Matrix3& M, Vector3* singular_values) {
  const Eigen::JacobiSVD<Matrix3> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (singular_values) *singular_values = svd.singularValues();
  Vector3 sign(1, 1, 1);
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign.z() = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix2d nearest_rotation(const Eigen::Matrix2d& M) {
  return Eigen::Rotation2Dd(std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1))).toRotationMatrix();
}

}  // namespace twofold
