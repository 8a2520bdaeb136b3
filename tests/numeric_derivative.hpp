#pragma once

#include <Eigen/Core>

namespace twofold {

/// d f / d x by central differences; f takes and returns fixed-size vectors.
template <class F, int N>
auto central_difference(F&& f, const Eigen::Matrix<double, N, 1>& x, double h = 1e-6) {
  using Result = decltype(f(x));
  Eigen::Matrix<double, Result::RowsAtCompileTime, N> J;
  for (int i = 0; i < N; ++i) {
    Eigen::Matrix<double, N, 1> plus = x, minus = x;
    plus[i] += h;
    minus[i] -= h;
    const Result f_plus = f(plus);
    const Result f_minus = f(minus);
    J.col(i) = (f_plus - f_minus) / (2 * h);
  }
  return J;
}

}  // namespace twofold
