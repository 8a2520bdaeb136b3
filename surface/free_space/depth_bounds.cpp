#include "surface/free_space/depth_bounds.hpp"

namespace twofold {
namespace {

void widen(DepthBounds::Range& range, const DepthBounds::Range& by) {
  range.nearest = std::min(range.nearest, by.nearest);
  range.farthest = std::max(range.farthest, by.farthest);
}

}  // namespace

DepthBounds::DepthBounds(const DepthView& view) {
  Level tiles{view.tiles.cols, view.tiles.rows, {}};
  tiles.ranges.reserve(view.tiles.total());
  for (int y = 0; y < tiles.rows; ++y) {
    const auto* row = view.tiles.ptr<DepthTile>(y);
    for (int x = 0; x < tiles.columns; ++x) tiles.ranges.push_back({row[x].nearest, row[x].farthest});
  }
  levels_.push_back(std::move(tiles));
  while (levels_.back().ranges.size() > 1) levels_.push_back(halved(levels_.back()));
}

DepthBounds::Level DepthBounds::halved(const Level& level) {
  Level half{(level.columns + 1) / 2, (level.rows + 1) / 2, {}};
  half.ranges.reserve(static_cast<std::size_t>(half.columns) * static_cast<std::size_t>(half.rows));
  for (int y = 0; y < half.rows; ++y)
    for (int x = 0; x < half.columns; ++x) {
      Range range = level.at(2 * x, 2 * y);
      const int right = std::min(2 * x + 1, level.columns - 1), below = std::min(2 * y + 1, level.rows - 1);
      widen(range, level.at(right, 2 * y));
      widen(range, level.at(2 * x, below));
      widen(range, level.at(right, below));
      half.ranges.push_back(range);
    }
  return half;
}

DepthBounds::Range DepthBounds::within(int x0, int y0, int x1, int y1) const {
  x0 /= kDepthTile, x1 /= kDepthTile, y0 /= kDepthTile, y1 /= kDepthTile;
  std::size_t l = 0;
  for (; x1 - x0 >= kMostLooks || y1 - y0 >= kMostLooks; ++l) x0 /= 2, x1 /= 2, y0 /= 2, y1 /= 2;
  const Level& level = levels_[l];
  Range range = level.at(x0, y0);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) widen(range, level.at(x, y));
  return range;
}

}  // namespace twofold
