#pragma once

#include "geometry/types.hpp"

namespace twofold {

using Vector8 = Eigen::Matrix<double, 8, 1>;
using Matrix8 = Eigen::Matrix<double, 8, 8>;

// Eigen's LDL^T with pivots, in the sizes that several rooms solve: compiled once here, where each file would
// otherwise take the compiler three seconds longer. Nothing is allocated.

/// x of A x = b, of symmetric A whose lower triangle is read. Not finite, or any solution, where A is
/// singular.
[[nodiscard]] Vector6 solve_symmetric(const Matrix6& A, const Vector6& b);
[[nodiscard]] Vector8 solve_symmetric(const Matrix8& A, const Vector8& b);
/// A^-1 of symmetric A whose lower triangle is read. Not finite, or of no meaning, where A is singular.
[[nodiscard]] Matrix6 inverse_symmetric(const Matrix6& A);

}  // namespace twofold
