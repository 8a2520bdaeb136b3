#pragma once

#include <span>
#include <vector>

#include "camera/pinhole.hpp"
#include "imaging/binary_descriptor.hpp"

namespace twofold {

/// The corners of a view in square cells, a grid for each level, so that a search looks at a few of them
/// only.
class CornerGrid {
 public:
  /// @param corners  outlive the grid
  /// @param radius_px  the largest that is searched, pixels of a corner's level
  CornerGrid(const PinholeCamera& camera, std::span<const DescribedCorner> corners, double radius_px);

  /// The corner most like `descriptor` in the square of half-width `radius_px`, pixels of the corner's own
  /// level, around uv [level-0 pixels], the upper one among equals. `best` is its position in `corners`, -1
  /// if there is none.
  [[nodiscard]] NearestDescriptor nearest(const Vector2& uv, const BinaryDescriptor& descriptor,
                                          double radius_px) const;

 private:
  struct Entry {
    Vector2 uv;
    int corner = 0;
    int rank = 0;  ///< from top to bottom
    const BinaryDescriptor* descriptor = nullptr;
  };
  struct Level {
    double pixel = 1;     ///< of the level, in those of level 0
    double per_cell = 1;  ///< cells a pixel of level 0
    int columns = 1, rows = 1;
    std::vector<Entry> entries;  ///< by cell, row by row
    std::vector<int> begin;      ///< of each cell's entries, and the end of the last

    [[nodiscard]] Eigen::Array2i cell_of(const Eigen::Array2d& uv) const;
    [[nodiscard]] std::size_t index_of(const Vector2& uv) const;
  };

  static void fill(Level& grid, int level, std::span<const DescribedCorner> corners,
                   std::span<const int> order);

  std::vector<Level> levels_;  ///< those that have corners
};

}  // namespace twofold
