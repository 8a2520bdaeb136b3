#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "sparse/block_structure.hpp"

namespace twofold {

/// Cholesky factor of a block system. Two kinds share this interface because neither is fast everywhere:
/// block by block for systems with little fill; in panels of columns with the same rows (supernodes) for
/// those whose fill makes long products. Both are made of products of a fixed number of rows and columns, by
/// kernels of this project: on panels a few blocks wide a BLAS spends its time on calls and on gathering and
/// scattering what it works on.
///
/// Not thread-safe. Deterministic.
class BlockFactor {
 public:
  virtual ~BlockFactor() = default;

  /// Of A + damping * diag(A). False when that is not positive definite.
  /// @param blocks  of A as the structure lists them, column-major; diagonal blocks count below the diagonal
  [[nodiscard]] virtual bool factorise(std::span<const double> blocks, double damping) = 0;
  /// x becomes A^-1 x with the last factor; rows in elimination order, any number of columns.
  virtual void solve(Eigen::MatrixXd& x) = 0;
};

/// Block sizes 1 (scalar), 2, 3, 6, 7. The structure must outlive the factor.
[[nodiscard]] std::unique_ptr<BlockFactor> make_simplicial_factor(const BlockStructure& structure,
                                                                  int block_size);
[[nodiscard]] std::unique_ptr<BlockFactor> make_supernodal_factor(const BlockStructure& structure,
                                                                  int block_size);

}  // namespace twofold
