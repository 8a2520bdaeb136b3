#pragma once

#include <array>
#include <cstdint>

#include "geometry/types.hpp"

namespace twofold {

/// 256 brightness comparisons around a corner.
struct BinaryDescriptor {
  std::array<std::uint64_t, 4> bits{};

  friend bool operator==(const BinaryDescriptor&, const BinaryDescriptor&) = default;
};

/// A corner that can be told from others by what it looks like.
struct DescribedCorner {
  Eigen::Vector2f uv{0, 0};  ///< level-0 pixel
  std::uint8_t level = 0;    ///< pyramid level it was found and described on
  float angle = 0;           ///< direction of the intensity centroid, [0, 2 pi) clockwise from the u axis
  BinaryDescriptor descriptor;
};

}  // namespace twofold
