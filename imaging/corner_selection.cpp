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
  const cv::Mat& base = pyramid.level(0);
  for (int level = 0; level < options_.levels; ++level) {
    const int wanted = share_of_level(options_.wanted, level, options_.levels);
    const double cell = std::sqrt(static_cast<double>(base.total()) / (kCellsPerCorner * wanted));
    CellGrid grid;
    grid.cell_px = std::max(kSmallestCell, 4 * static_cast<int>(std::lround(cell / 4)));
    grid.columns = base.cols / grid.cell_px + 1;
    grid.rows = base.rows / grid.cell_px + 1;
    free_cells_.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows), 0);
    grid.occupied = free_cells_;
    found_.clear();
    found_.reserve(free_cells_.size());
    detect_corners(pyramid.level(level), level, options_.threshold, options_.min_score, kDescriptorBorder,
                   grid, found_);
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
}

}  // namespace twofold
