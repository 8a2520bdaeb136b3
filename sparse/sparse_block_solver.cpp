#include "sparse/sparse_block_solver.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace twofold {

void SparseBlockSolver::set_structure(const BlockStructure& structure, int block_size) {
  // Flops from which panels gain more than they take to gather.
  constexpr double kWorthPanels = 4e7;
  structure_ = &structure;
  block_size_ = block_size;
  blocks_.assign(structure.system_row.size() * block_size * block_size, 0.0);
  const bool panels = structure.flops(block_size) > kWorthPanels;
  factor_ =
      panels ? make_supernodal_factor(structure, block_size) : make_simplicial_factor(structure, block_size);
}

void SparseBlockSolver::set_zero() {
  std::fill(blocks_.begin(), blocks_.end(), 0.0);
}

Eigen::MatrixXd SparseBlockSolver::solve(const Eigen::MatrixXd& b) {
  TWOFOLD_CHECK(b.rows() == dimension(), "one row per unknown");
  const int n = block_size_;
  ordered_.resize(b.rows(), b.cols());
  for (Eigen::Index c = 0; c < b.cols(); ++c) {
    for (int k = 0; k < structure_->nodes(); ++k) {
      std::copy_n(b.col(c).data() + n * structure_->order[k], n, ordered_.col(c).data() + n * k);
    }
  }
  factor_->solve(ordered_);
  Eigen::MatrixXd x(b.rows(), b.cols());
  for (Eigen::Index c = 0; c < b.cols(); ++c) {
    for (int k = 0; k < structure_->nodes(); ++k) {
      std::copy_n(ordered_.col(c).data() + n * k, n, x.col(c).data() + n * structure_->order[k]);
    }
  }
  return x;
}

}  // namespace twofold
