#include "imaging/corner_selection.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "imaging/level_pixels.hpp"

namespace twofold {
namespace {

constexpr double kCellsPerCorner = 1.5;  // cells without texture give nothing: more than corners are wanted
constexpr int kSmallestCell = 8;         // [level-0 px] below it, corners of one cell are hardly two

/// Corners wanted of a level: halved from level to level.
int share_of_level(int wanted, int level, int levels) {
  const int parts = (1 << levels) - 1;
  return std::max(1, wanted * (1 << (levels - 1 - level)) / parts);
}

/// Without the occupied cells.
CellGrid grid_for(const cv::Mat& image, int wanted) {
  const double cell = std::sqrt(static_cast<double>(image.total()) / (kCellsPerCorner * wanted));
  CellGrid grid;
  grid.cell_px = std::max(
      {kSmallestCell, CellGrid::smallest_cell_px(image.cols), 4 * static_cast<int>(std::lround(cell / 4))});
  grid.columns = image.cols / grid.cell_px + 1;
  grid.rows = image.rows / grid.cell_px + 1;
  return grid;
}

std::size_t cell_count(const CellGrid& grid) {
  return static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows);
}

bool stronger(const Corner& a, const Corner& b) {
  return std::tuple(-a.score, a.v, a.u) < std::tuple(-b.score, b.v, b.u);
}

}  // namespace

CornerSelector::CornerSelector(const CornerSelectionOptions& options) : options_(options) {}

void CornerSelector::select(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  corners.clear();
  // No pass has more cells than one for all corners: dark or not, no image of the same size allocates again.
  const std::size_t most_cells = cell_count(grid_for(pyramid.level(0), options_.wanted));
  occupied_.reserve(most_cells);
  found_.reserve(most_cells);
  for (int level = 0; level < options_.levels; ++level) {
    const int wanted = share_of_level(options_.wanted, level, options_.levels);
    add(pyramid, level, wanted, {options_.threshold, options_.min_score}, corners);
  }
  if (mean_brightness(pyramid) < options_.faint.dark_below) add_faint(pyramid, corners);
}

/// Low contrast is for want of light there, not of texture: fainter corners instead of those that are
/// missing, where the pyramid has averaged the noise away.
void CornerSelector::add_faint(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  const Bounds faint{options_.faint.threshold(options_.threshold), options_.faint.score(options_.min_score)};
  for (int level = 1; level < options_.levels; ++level) {
    const auto before = static_cast<std::ptrdiff_t>(corners.size());
    if (before >= options_.wanted) return;
    add(pyramid, level, options_.wanted - static_cast<int>(before), faint, corners);
    const auto added = corners.begin() + before;
    const auto next_level = std::find_if(corners.begin(), added,
                                         [&](const DescribedCorner& corner) { return corner.level > level; });
    std::rotate(next_level, added, corners.end());
  }
}

/// The strongest corners of a level, `wanted` at most, in cells where none of that level was added before.
void CornerSelector::add(const ImagePyramid& pyramid, int level, int wanted, const Bounds& bounds,
                         std::vector<DescribedCorner>& corners) {
  CellGrid grid = grid_for(pyramid.level(0), wanted);
  occupied_.assign(cell_count(grid), 0);
  for (const DescribedCorner& corner : corners) {
    if (corner.level != level) continue;
    const int column = static_cast<int>(corner.uv.x()) / grid.cell_px;
    const int row = static_cast<int>(corner.uv.y()) / grid.cell_px;
    occupied_[static_cast<std::size_t>(row * grid.columns + column)] = 1;
  }
  grid.occupied = occupied_;
  found_.clear();
  detect_corners(pyramid.level(level), level, bounds.threshold, bounds.min_score, kDescriptorBorder, grid,
                 found_);
  std::sort(found_.begin(), found_.end(), stronger);
  if (static_cast<int>(found_.size()) > wanted) found_.resize(static_cast<std::size_t>(wanted));
  for (const Corner& corner : found_) {
    DescribedCorner described;
    described.uv = {static_cast<float>(from_level(corner.u, level)),
                    static_cast<float>(from_level(corner.v, level))};
    described.level = corner.level;
    corners.push_back(described);
  }
}

}  // namespace twofold
