#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/types.hpp"

namespace twofold {

/// 256 brightness comparisons around a corner.
struct BinaryDescriptor {
  std::array<std::uint64_t, 4> bits{};

  friend bool operator==(const BinaryDescriptor&, const BinaryDescriptor&) = default;
};

/// A corner as a place is recognised by.
struct DescribedCorner {
  Eigen::Vector2f uv{0, 0};  ///< level-0 pixel
  std::uint8_t level = 0;    ///< pyramid level it was found and described on
  float angle = 0;           ///< direction of the intensity centroid, [0, 2 pi) clockwise from the u axis
  BinaryDescriptor descriptor;
};

/// How the place of a keyframe looks, and where its corners are: what recognition needs of it, besides words,
/// which follow from the descriptors.
struct PlaceAppearance {
  std::vector<DescribedCorner> corners;
  /// In step with corners: (u_l, v_l, u_r) level-0 pixels; u_r is Rig::kNoRight where no depth is known.
  /// Empty for a monocular rig.
  std::vector<Eigen::Vector3f> z;
};

}  // namespace twofold
