#pragma once

#include "filters/sliding_window_filter_equations.hpp"

namespace twofold {

// Products and solutions with matrices of any size. Eigen compiles them anew for every type of expression,
// for seconds each: here they are compiled once, for views of columns.
using MatrixView = Eigen::Ref<MatrixX>;
using ConstMatrixView = Eigen::Ref<const MatrixX>;

/// C += scale A B. A transposed operand is copied first. C is part of neither.
void add_product(MatrixView C, double scale, const ConstMatrixView& A, const ConstMatrixView& B);
/// X <- L^-1 X, L lower triangular; what stands above its diagonal is not read.
void solve_lower(const ConstMatrixView& L, MatrixView X);
/// X <- L^-T X
void solve_lower_transposed(const ConstMatrixView& L, MatrixView X);

}  // namespace twofold
