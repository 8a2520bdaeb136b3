#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

namespace twofold {

/// Order in which to eliminate the nodes of an undirected graph so that Cholesky's fill stays small: the
/// better of minimum degree (AMD) and nested dissection (METIS) by the flops they lead to, postordered.
///
/// @param edges  pairs of different nodes in [0, nodes); repetitions are allowed
/// @param block_size  unknowns a node stands for
/// @return       order[k] = node eliminated k-th
[[nodiscard]] std::vector<int> elimination_order(int nodes, std::span<const std::pair<int, int>> edges,
                                                 int block_size);

/// Symmetric positive definite block system A x = b with square blocks of one size, factorised by CHOLMOD's
/// supernodal Cholesky. The symbolic analysis happens once in set_pattern. Blocks are stored in elimination
/// order, column by column, lower triangle: the very form CHOLMOD factorises without copying.
///
/// Not thread-safe; one instance a thread. Deterministic with a single-threaded BLAS.
class CholmodSolver {
 public:
  CholmodSolver();
  ~CholmodSolver();
  CholmodSolver(CholmodSolver&&) noexcept;
  CholmodSolver& operator=(CholmodSolver&&) noexcept;

  /// Where an off-diagonal block is stored.
  struct Slot {
    int column = 0;           ///< block column
    int place = 0;            ///< position below the diagonal block
    bool transposed = false;  ///< the block stored is A_ji
  };

  /// Lays out blocks (i, i) and (i, j), (j, i) for every edge; all values are zero.
  /// @param order  permutation of [0, blocks), e.g. elimination_order of the edges
  /// @return       for every edge {i, j} the slot of A_ij
  std::vector<Slot> set_pattern(int block_size, std::span<const int> order,
                                std::span<const std::pair<int, int>> edges);

  [[nodiscard]] int dimension() const { return block_size_ * static_cast<int>(position_.size()); }
  /// Entries of the factor, as the symbolic analysis predicts them.
  [[nodiscard]] double factor_entries() const;

  void set_zero();
  template <int N>
  void add_diagonal(int i, const Eigen::Matrix<double, N, N>& block);
  template <int N>
  void add_off_diagonal(const Slot& slot, const Eigen::Matrix<double, N, N>& A_ij);

  /// Cholesky factor of A + damping * diag(A); A itself stays. False when that is not positive definite.
  [[nodiscard]] bool factorise(double damping);
  /// x = A^-1 b with the last factor. Both are dimension() x k, blocks in the caller's numbering; k any.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& b);

 private:
  struct Cholmod;

  [[nodiscard]] double* column_of_diagonal(int block_column, int c) {
    return values_.data() + column_begin_[block_size_ * block_column + c];
  }

  int block_size_ = 0;
  std::vector<int> position_;  // position_[i]: block column of block i
  std::vector<int> column_begin_;
  std::vector<int> row_;
  std::vector<double> values_;
  std::unique_ptr<Cholmod> cholmod_;
};

template <int N>
void CholmodSolver::add_diagonal(int i, const Eigen::Matrix<double, N, N>& block) {
  for (int c = 0; c < N; ++c) {
    double* column = column_of_diagonal(position_[i], c);  // starts on the diagonal
    for (int r = c; r < N; ++r) column[r - c] += block(r, c);
  }
}

template <int N>
void CholmodSolver::add_off_diagonal(const Slot& slot, const Eigen::Matrix<double, N, N>& A_ij) {
  for (int c = 0; c < N; ++c) {
    Eigen::Map<Eigen::Matrix<double, N, 1>> column(column_of_diagonal(slot.column, c) + (N - c) +
                                                   N * slot.place);
    if (slot.transposed) {
      column += A_ij.row(c).transpose();
    } else {
      column += A_ij.col(c);
    }
  }
}

}  // namespace twofold
