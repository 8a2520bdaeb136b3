#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

namespace twofold {

struct Corner {
  std::int16_t u = 0;  ///< whole pixel of the image it was found in
  std::int16_t v = 0;
  std::uint8_t level = 0;
  float score = 0;  ///< Shi-Tomasi: smaller eigenvalue of the 8x8 structure tensor [grey^2/px^2], per pixel
};

/// Cells of an image, in level-0 pixels; those that hold a point already need no corner.
struct CellGrid {
  static constexpr int kMaxColumns = 256;

  int cell_px = 32;  ///< side of a cell, a multiple of 4
  int columns = 0;   ///< kMaxColumns at most
  int rows = 0;
  std::span<const std::uint8_t> occupied;  ///< columns * rows, row-major; non-zero: no corner wanted

  /// Side of the smallest cells that an image so wide can be parted into.
  [[nodiscard]] static constexpr int smallest_cell_px(int image_width) {
    return (image_width / kMaxColumns + 4) / 4 * 4;
  }
};

/// FAST-9 corners (Rosten and Drummond, ECCV 2006): nine of the sixteen pixels on the circle of radius 3 in a
/// row are all brighter or all darker than the centre by `threshold`. Each free cell gives its corner of
/// highest score, if that is at least `min_score`, which spreads them and thins neighbours out.
///
/// `image` is level `level` (0 to 2) of the pyramid the grid is laid over. Appends to `corners`, never beyond
/// its capacity (no allocation). `border`: pixels of the level left out along the edges, >= 8.
void detect_corners(const cv::Mat& image, int level, int threshold, float min_score, int border,
                    const CellGrid& grid, std::vector<Corner>& corners);

}  // namespace twofold
