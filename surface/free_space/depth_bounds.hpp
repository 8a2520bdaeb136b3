#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "surface/depth_view.hpp"

namespace twofold {

/// Bounds of a depth image's readings in any rectangle of it: its tiles, and these by two and two again and
/// again, so that a rectangle costs a few looks, however large it is.
class DepthBounds {
 public:
  struct Range {
    float nearest = 0;   ///< as DepthTile::nearest
    float farthest = 0;  ///< as DepthTile::farthest
  };

  explicit DepthBounds(const DepthView& view);

  /// Of pixels x0 .. x1 and y0 .. y1, which are in the image, and some around them.
  [[nodiscard]] Range within(int x0, int y0, int x1, int y1) const;
  [[nodiscard]] Range whole_image() const { return levels_.back().ranges.front(); }

 private:
  static constexpr int kMostLooks = 6;  // along an edge of a rectangle
  struct Level {
    int columns = 0, rows = 0;
    std::vector<Range> ranges;
    [[nodiscard]] const Range& at(int x, int y) const {
      return ranges[static_cast<std::size_t>(y) * static_cast<std::size_t>(columns) +
                    static_cast<std::size_t>(x)];
    }
  };
  [[nodiscard]] static Level halved(const Level& level);

  std::vector<Level> levels_;
};

}  // namespace twofold
