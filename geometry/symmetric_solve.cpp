#include "geometry/symmetric_solve.hpp"

#include <Eigen/Cholesky>

namespace twofold {

Vector6 solve_symmetric(const Matrix6& A, const Vector6& b) {
  return A.ldlt().solve(b);
}

Vector8 solve_symmetric(const Matrix8& A, const Vector8& b) {
  return A.ldlt().solve(b);
}

Matrix6 inverse_symmetric(const Matrix6& A) {
  return A.ldlt().solve(Matrix6::Identity());
}

}  // namespace twofold
