#include "geometry/nearest_rotation.hpp"

#include <Eigen/SVD>
#include <limits>

namespace twofold {

std::optional<SingularValueDecomposition> decompose(const Matrix3& M) {
  if (!M.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Matrix3> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return SingularValueDecomposition{svd.matrixU(), svd.matrixV(), svd.singularValues()};
}

Matrix3 nearest_rotation(const Matrix3& M, Vector3* singular_values) {
  const auto svd = decompose(M);
  if (!svd) {
    constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
    if (singular_values) singular_values->setConstant(kNaN);
    return Matrix3::Constant(kNaN);
  }
  if (singular_values) *singular_values = svd->singular_values;
  Vector3 sign(1, 1, 1);
  if ((svd->U * svd->V.transpose()).determinant() < 0) sign.z() = -1;
  return svd->U * sign.asDiagonal() * svd->V.transpose();
}

Eigen::Matrix2d nearest_rotation(const Eigen::Matrix2d& M) {
  return Eigen::Rotation2Dd(std::atan2(M(1, 0) - M(0, 1), M(0, 0) + M(1, 1))).toRotationMatrix();
}

}  // namespace twofold
