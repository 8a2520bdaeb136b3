#pragma once

#include <span>
#include <utility>
#include <vector>

namespace twofold {

/// Which blocks a symmetric block system and its Cholesky factor have, in an elimination order that keeps the
/// fill small. It depends on the graph alone: one analysis serves systems of any block size over the same
/// graph.
///
/// Rows and columns below are positions in the elimination order; blocks stand column by column, the diagonal
/// block first, then rows rising.
struct BlockStructure {
  /// Off-diagonal block of an edge.
  struct Slot {
    int block = 0;            ///< of the system
    bool transposed = false;  ///< the block stored is A_ji
  };
  struct RowEntry {
    int column, block;
  };

  std::vector<int> order;                     ///< order[k]: node eliminated k-th
  std::vector<int> position;                  ///< inverse of order
  std::vector<int> system_begin, system_row;  ///< lower triangle of the system: column j has the blocks
                                              ///< [begin[j], begin[j + 1])
  std::vector<Slot> slots;                    ///< by edge
  std::vector<int> factor_begin, factor_row;  ///< likewise of the factor
  std::vector<int> factor_block;              ///< where each block of the system stands in the factor
  std::vector<int> row_begin;                 ///< row k of the factor left of the diagonal: entries
  std::vector<RowEntry> row_entries;          ///< [begin[k], begin[k + 1])
  double block_products = 0;                  ///< that a factorisation takes

  [[nodiscard]] int nodes() const { return static_cast<int>(order.size()); }
  /// Of a factorisation with blocks of this size.
  [[nodiscard]] double flops(int block_size) const;
};

/// Order by minimum degree (AMD); where a factorisation is very long, nested dissection (METIS) is tried too,
/// and the one with fewer flops is taken.
///
/// @param edges       pairs of different nodes in [0, nodes); repetitions are allowed
/// @param block_size  of the largest system to be factorised
[[nodiscard]] BlockStructure analyse_blocks(int nodes, std::span<const std::pair<int, int>> edges,
                                            int block_size);

}  // namespace twofold
