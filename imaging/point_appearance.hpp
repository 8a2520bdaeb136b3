#pragma once

#include <array>
#include <cstdint>

#include "geometry/types.hpp"

namespace twofold {

/// How a point looked in its anchor keyframe: the pixels around it at the pyramid level it was found on.
struct PointAppearance {
  static constexpr int kSize =
      16;  ///< wide enough to warp an 8x8 patch with a scale of up to 1.4 and any rotation

  /// Row-major; pixels[r][c] is sampled at uv_level + (c - (kSize - 1) / 2, r - (kSize - 1) / 2)  (half-pixel
  /// centre).
  std::array<std::uint8_t, kSize * kSize> pixels{};
  Eigen::Vector2f uv{
      0, 0};  ///< level-0 pixel in the anchor keyframe; psi.head<2>() up to the back-end's refinement
  std::uint8_t level = 0;  ///< pyramid level the pixels come from
};

}  // namespace twofold
