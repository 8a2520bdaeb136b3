#pragma once

#include <string>

#include "tracking/depth/depth_alignment.hpp"

namespace twofold {

/// When a depth camera is placed by its depth image (tracking/tracker_depth.cpp).
struct DepthPlacementOptions {
  DepthAlignmentOptions alignment;
  int scarce_inliers = 40;  ///< with fewer it is placed by its depth image as well, >= 0
  /// After a loss, a pose from the depth image alone is rejected when so many points should be seen from it
  /// and the search does not confirm it, >= 0.
  int telling_candidates = 40;
  /// A pose by depth and points replaces one by points alone, after a loss or where that is as well supported
  /// as one from a rough start must be (RoughStartOptions), when so large a share of the latter's inliers
  /// agrees with it, in (0, 1].
  double agreeing_share = 0.5;
  int patience = 5;  ///< lost frames, beyond which the depth image alone places nothing, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
