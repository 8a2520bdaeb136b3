#include "geometry/svd.hpp"

#include <Eigen/SVD>

namespace twofold {

std::optional<SingularValueDecomposition> decompose(const Matrix3& M) {
  if (!M.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Matrix3> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return SingularValueDecomposition{svd.matrixU(), svd.matrixV(), svd.singularValues()};
}

}  // namespace twofold
