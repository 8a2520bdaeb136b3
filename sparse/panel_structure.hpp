#pragma once

#include <cstddef>
#include <vector>

#include "sparse/block_structure.hpp"

namespace twofold {

/// Neighbouring columns of a block factor with the same rows, or almost, gathered into panels: the supernodes
/// of sparse Cholesky factorisation (Davis, Direct Methods for Sparse Linear Systems, 4.8).
///
/// The rows of a panel ascend and begin with its own columns, so that it is one dense trapezoid. Where its
/// columns differ in their rows, and above the diagonal, it stores blocks of zeros that the factor does not
/// have.
struct PanelStructure {
  struct Panel {
    int first, width;    ///< columns [first, first + width)
    int begin, end;      ///< its rows, in `row`
    std::size_t blocks;  ///< of all panels before this one
    [[nodiscard]] int height() const { return end - begin; }
  };
  /// What a panel owes to a later one: its rows [begin, end), counted from its first, are columns there.
  struct Update {
    int panel;
    int begin, end;
  };

  std::vector<Panel> panels;
  std::vector<int> row;
  std::vector<int> update_begin;  ///< panel p takes the updates [begin[p], begin[p + 1])
  std::vector<Update> updates;
  std::size_t blocks = 0;  ///< of all panels
};

[[nodiscard]] PanelStructure gather_panels(const BlockStructure& structure);

}  // namespace twofold
