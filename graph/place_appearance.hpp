#pragma once

#include <vector>

#include "camera/measurement.hpp"
#include "imaging/described_corner.hpp"

namespace twofold {

/// How the place of a keyframe looks, and where its corners are: what recognition needs of it, besides words,
/// which follow from the descriptors.
struct PlaceAppearance {
  std::vector<DescribedCorner> corners;
  /// In step with corners; without a right coordinate where no depth is known. Empty as stored for a
  /// monocular rig (loopclosure/depth_regression.hpp fills it).
  std::vector<StereoPixelF> pixels;
};

}  // namespace twofold
