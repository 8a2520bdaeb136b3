#pragma once

#include <array>
#include <cstdint>

#include "geometry/types.hpp"

namespace twofold {

/// How a point looked in its anchor keyframe: the pixels around it at the pyramid level it was found on.
struct PointAppearance {
  static constexpr int kSize =
      16;  ///< wide enough to warp an 8x8 patch with a scale of up to 1.4 and any rotation
  static constexpr int kCentre = 8;  ///< row and column of the corner itself

  /// Row-major, unfiltered: pixels[r][c] is the pixel of `level` at (c - kCentre, r - kCentre) from the
  /// corner.
  std::array<std::uint8_t, kSize * kSize> pixels{};
  Eigen::Vector2f uv{0, 0};  ///< corner in level-0 pixels of the anchor keyframe; a whole pixel of `level`
  std::uint8_t level = 0;    ///< pyramid level the pixels come from
};

}  // namespace twofold
