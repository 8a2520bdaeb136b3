#include "imaging/corner_selection.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace twofold {
namespace {

// Cells without texture give nothing: more are laid out than corners are wanted.
constexpr double kCellsPerCorner = 1.5;
constexpr int kSmallestCell = 8;  // [level-0 px]

/// Corners wanted of a level: halved from level to level.
int share_of_level(int wanted, int level, int levels) {
  const int parts = (1 << levels) - 1;
  return std::max(1, wanted * (1 << (levels - 1 - level)) / parts);
}

bool stronger(const Corner& a, const Corner& b) {
  return std::tuple(-a.score, a.v, a.u) < std::tuple(-b.score, b.v, b.u);
}

}  // namespace

CornerSelector::CornerSelector(const CornerSelectionOptions& options) : options_(options) {}

void CornerSelector::select(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  corners.clear();
  for (int level = 0; level < options_.levels; ++level) {
    const int wanted = share_of_level(options_.wanted, level, options_.levels);
    add(pyramid, level, wanted, {options_.threshold, options_.min_score}, corners);
  }
  if (is_dark(pyramid)) add_faint(pyramid, corners);
}

/// Low contrast is for want of light there, not of texture: fainter corners instead of those that are
/// missing, where the pyramid has averaged the noise away.
void CornerSelector::add_faint(const ImagePyramid& pyramid, std::vector<DescribedCorner>& corners) {
  const Bounds faint{std::max(options_.threshold / 2, 1), options_.min_score / 4};
  for (int level = 1; level < options_.levels; ++level) {
    const int missing = options_.wanted - static_cast<int>(corners.size());
    if (missing > 0) add(pyramid, level, missing, faint, corners);
  }
  std::stable_sort(corners.begin(), corners.end(),
                   [](const DescribedCorner& a, const DescribedCorner& b) { return a.level < b.level; });
}

/// The strongest corners of a level, `wanted` at most, in cells where none of that level was added before.
void CornerSelector::add(const ImagePyramid& pyramid, int level, int wanted, const Bounds& bounds,
                         std::vector<DescribedCorner>& corners) {
  const cv::Mat& base = pyramid.level(0);
  const double cell = std::sqrt(static_cast<double>(base.total()) / (kCellsPerCorner * wanted));
  CellGrid grid;
  grid.cell_px = std::max(
      {kSmallestCell, CellGrid::smallest_cell_px(base.cols), 4 * static_cast<int>(std::lround(cell / 4))});
  grid.columns = base.cols / grid.cell_px + 1;
  grid.rows = base.rows / grid.cell_px + 1;
  occupied_.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows), 0);
  for (const DescribedCorner& corner : corners) {
    if (corner.level != level) continue;
    const int column = static_cast<int>(corner.uv.x()) / grid.cell_px;
    const int row = static_cast<int>(corner.uv.y()) / grid.cell_px;
    occupied_[static_cast<std::size_t>(row * grid.columns + column)] = 1;
  }
  grid.occupied = occupied_;
  found_.clear();
  found_.reserve(occupied_.size());
  detect_corners(pyramid.level(level), level, bounds.threshold, bounds.min_score, kDescriptorBorder, grid,
                 found_);
  std::sort(found_.begin(), found_.end(), stronger);
  if (static_cast<int>(found_.size()) > wanted) found_.resize(static_cast<std::size_t>(wanted));
  const float scale = std::ldexp(1.0F, level);
  for (const Corner& corner : found_) {
    DescribedCorner described;
    described.uv = {(static_cast<float>(corner.u) + 0.5F) * scale - 0.5F,
                    (static_cast<float>(corner.v) + 0.5F) * scale - 0.5F};
    described.level = corner.level;
    corners.push_back(described);
  }
}

}  // namespace twofold
