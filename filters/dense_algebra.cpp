#include "filters/dense_algebra.hpp"

namespace twofold {

void add_product(MatrixView C, double scale, const ConstMatrixView& A, const ConstMatrixView& B) {
  C.noalias() += scale * A * B;
}

void solve_lower(const ConstMatrixView& L, MatrixView X) {
  if (X.size() > 0) L.triangularView<Eigen::Lower>().solveInPlace(X);
}

void solve_lower_transposed(const ConstMatrixView& L, MatrixView X) {
  if (X.size() > 0) L.transpose().triangularView<Eigen::Upper>().solveInPlace(X);
}

}  // namespace twofold
