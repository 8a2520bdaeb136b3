#pragma once

#include <vector>

#include "imaging/described_corner.hpp"

namespace twofold {

/// How the place of a keyframe looks, and where its corners are: what recognition needs of it, besides words,
/// which follow from the descriptors.
struct PlaceAppearance {
  std::vector<DescribedCorner> corners;
  /// In step with corners: (u_l, v_l, u_r) level-0 pixels; u_r is Rig::kNoRight where no depth is known.
  /// Empty as stored for a monocular rig (loopclosure/depth_regression.hpp fills it).
  std::vector<Eigen::Vector3f> z;
};

}  // namespace twofold
