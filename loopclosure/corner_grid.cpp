#include "loopclosure/corner_grid.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "imaging/image_pyramid.hpp"

namespace twofold {

CornerGrid::CornerGrid(const PinholeCamera& camera, std::span<const DescribedCorner> corners,
                       double radius_px) {
  std::vector<int> order(corners.size());  // from top to bottom
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
    return corners[static_cast<std::size_t>(a)].uv.y() < corners[static_cast<std::size_t>(b)].uv.y();
  });
  for (int level = 0; level < ImagePyramid::kLevels; ++level) {
    Level grid;
    grid.pixel = std::ldexp(1.0, level);
    grid.per_cell = 1 / (2 * grid.pixel * radius_px);  // a search meets four cells at most
    grid.columns = static_cast<int>(camera.width * grid.per_cell) + 1;
    grid.rows = static_cast<int>(camera.height * grid.per_cell) + 1;
    fill(grid, level, corners, order);
    if (!grid.entries.empty()) levels_.push_back(std::move(grid));
  }
}

NearestDescriptor CornerGrid::nearest(const Vector2& uv, const BinaryDescriptor& descriptor,
                                      double radius_px) const {
  NearestDescriptor nearest;
  int rank = 0;
  for (const Level& grid : levels_) {
    const double radius = radius_px * grid.pixel;
    const Eigen::Array2i first = grid.cell_of(uv.array() - radius), last = grid.cell_of(uv.array() + radius);
    for (int row = first.y(); row <= last.y(); ++row) {
      const int in_row = row * grid.columns;
      const int begin = grid.begin[static_cast<std::size_t>(in_row + first.x())];
      const int end = grid.begin[static_cast<std::size_t>(in_row + last.x() + 1)];
      for (int e = begin; e < end; ++e) {
        const Entry& entry = grid.entries[static_cast<std::size_t>(e)];
        if ((entry.uv - uv).cwiseAbs().maxCoeff() > radius) continue;
        const int distance = hamming_distance(descriptor, *entry.descriptor);
        if (distance > nearest.distance || (distance == nearest.distance && entry.rank > rank)) continue;
        nearest = {entry.corner, distance};
        rank = entry.rank;
      }
    }
  }
  return nearest;
}

Eigen::Array2i CornerGrid::Level::cell_of(const Eigen::Array2d& uv) const {
  const Eigen::Array2d cell = (uv * per_cell).max(0).min(Eigen::Array2d(columns - 1, rows - 1));
  return cell.cast<int>();
}

std::size_t CornerGrid::Level::index_of(const Vector2& uv) const {
  const Eigen::Array2i cell = cell_of(uv.array());
  return static_cast<std::size_t>(cell.y() * columns + cell.x());
}

/// Sorts the level's corners into its cells, by counting.
void CornerGrid::fill(Level& grid, int level, std::span<const DescribedCorner> corners,
                      std::span<const int> order) {
  const auto on_level = [&](int j) { return corners[static_cast<std::size_t>(j)].level == level; };
  grid.begin.assign(static_cast<std::size_t>(grid.columns * grid.rows) + 1, 0);
  for (const int j : order) {
    if (on_level(j)) ++grid.begin[grid.index_of(corners[static_cast<std::size_t>(j)].uv.cast<double>()) + 1];
  }
  std::partial_sum(grid.begin.begin(), grid.begin.end(), grid.begin.begin());
  grid.entries.resize(static_cast<std::size_t>(grid.begin.back()));
  std::vector<int> next(grid.begin.begin(), grid.begin.end() - 1);
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const int j = order[rank];
    if (!on_level(j)) continue;
    const DescribedCorner& corner = corners[static_cast<std::size_t>(j)];
    const Vector2 uv = corner.uv.cast<double>();
    const auto at = static_cast<std::size_t>(next[grid.index_of(uv)]++);
    grid.entries[at] = {uv, j, static_cast<int>(rank), &corner.descriptor};
  }
}

}  // namespace twofold
