#pragma once

#include <span>
#include <vector>

#include "geometry/types.hpp"
#include "sparse/coupling_pattern.hpp"

namespace twofold {

/// Cholesky factorisation of a symmetric positive definite matrix of 6x6 blocks, in a fill-reducing order.
///
/// For the reduced camera systems of windows: tens to hundreds of poses, an almost dense inner part and a
/// sparse rim. Every block product is one fixed-size kernel, so nothing is lost on gathering dense panels,
/// and no BLAS (with threads of its own) is involved. The order and the pattern of the factor are kept while
/// the pattern of the matrix stays.
///
/// Use: set_pattern, set_zero, add into block(...), factorise, solve. Rows and columns are named by their
/// position in the elimination order, see position().
class BlockCholesky {
 public:
  void set_pattern(CouplingPattern pattern);

  [[nodiscard]] int size() const { return static_cast<int>(order_.size()); }
  /// Place of unknown i in the elimination order, for all i.
  [[nodiscard]] const std::vector<int>& position() const { return position_; }
  /// Index of the block at (row, column), row >= column, both positions; the pair must be in the pattern.
  [[nodiscard]] int block_index(int row, int column) const;
  [[nodiscard]] int diagonal_index(int column) const { return column_begin_[column]; }
  /// The same for many rows of one column: blocks[k] is that of rows[k], -1 where there is none.
  void block_indices(int column, std::span<const int> rows, std::span<int> blocks);

  void set_zero();
  /// Before factorise: block of the matrix, after it: of the factor.
  [[nodiscard]] Matrix6& block(int index) { return blocks_[index]; }
  [[nodiscard]] const Matrix6& block(int index) const { return blocks_[index]; }

  /// False when the matrix is not positive definite (to rounding); its blocks are lost either way.
  [[nodiscard]] bool factorise();
  /// Right-hand side in, solution out, six numbers an unknown, in elimination order.
  void solve(std::span<Vector6> rhs) const;

 private:
  struct RowEntry {
    int column, block;
  };

  void choose_order();
  void find_fill();
  template <std::size_t kColumns>
  void subtract_products(std::span<const RowEntry> columns);
  /// The two halves of solve, with L L^T = A: x becomes L^-1 x, or L^-T x.
  void solve_lower(std::span<Vector6> rhs) const;
  void solve_upper(std::span<Vector6> rhs) const;

  CouplingPattern pattern_;
  std::vector<int> order_;     // unknown at a position
  std::vector<int> position_;  // position of an unknown
  // Column j of the factor: blocks [column_begin_[j], column_begin_[j+1]), rows rising, the diagonal first.
  std::vector<int> column_begin_;
  std::vector<int> row_;
  // Row k of the factor left of the diagonal: which blocks, and the columns they stand in.
  std::vector<int> row_begin_;
  std::vector<RowEntry> row_entries_;
  std::vector<Matrix6> blocks_;
  std::vector<Matrix6> inverse_diagonal_;  // L_jj^-1, lower triangular
  std::vector<char> continues_;            // whether column j + 1 has all rows that column j has below it
  std::vector<int> place_;                 // scratch: block of a row in the column looked at last
};

}  // namespace twofold
