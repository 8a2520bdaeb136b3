#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sparse/block_factor.hpp"
#include "sparse/block_structure.hpp"

namespace twofold {

/// Symmetric positive definite block system A x = b with square blocks of one size over a structure analysed
/// before. Blocks (i, i) and those of the structure's edges are there; i and j number the nodes as the edges
/// do. Takes the kind of factor that is faster for the structure.
///
/// Not thread-safe; one instance a thread. Deterministic.
class SparseBlockSolver {
 public:
  /// All values are zero afterwards. The structure must outlive the solver, or its next set_structure.
  void set_structure(const BlockStructure& structure, int block_size);

  [[nodiscard]] int dimension() const { return block_size_ * structure_->nodes(); }

  void set_zero();
  template <int N>
  void add_diagonal(int i, const Eigen::Matrix<double, N, N>& A_ii) {
    at<N>(structure_->system_begin[structure_->position[i]]) += A_ii;
  }
  /// @param A_ij  for edge {i, j}
  template <int N>
  void add_off_diagonal(std::size_t edge, const Eigen::Matrix<double, N, N>& A_ij) {
    const BlockStructure::Slot slot = structure_->slots[edge];
    if (slot.transposed) {
      at<N>(slot.block) += A_ij.transpose();
    } else {
      at<N>(slot.block) += A_ij;
    }
  }

  /// Cholesky factor of A + damping * diag(A); A itself stays. False when that is not positive definite.
  [[nodiscard]] bool factorise(double damping) { return factor_->factorise(blocks_, damping); }
  /// x = A^-1 b with the last factor. Both are dimension() x k; k any.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& b);

 private:
  template <int N>
  [[nodiscard]] Eigen::Map<Eigen::Matrix<double, N, N>> at(int block) {
    return Eigen::Map<Eigen::Matrix<double, N, N>>(blocks_.data() + static_cast<std::size_t>(block) * N * N);
  }

  const BlockStructure* structure_ = nullptr;
  int block_size_ = 0;
  std::vector<double> blocks_;
  std::unique_ptr<BlockFactor> factor_;
  Eigen::MatrixXd ordered_;
};

}  // namespace twofold
