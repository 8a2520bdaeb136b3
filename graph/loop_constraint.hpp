#pragma once

#include <cstdint>

#include "geometry/se3.hpp"
#include "graph/ids.hpp"

namespace twofold {

/// Message of the loop closer to the mapper: both keyframes see the same place  (thesis 6.4.2).
struct LoopConstraint {
  std::uint64_t snapshot_version = 0;  ///< version it was computed from
  KeyframeId from = kNoKeyframe;
  KeyframeId to = kNoKeyframe;
  SE3 T_to_from;    ///< verified geometrically [m]
  int inliers = 0;  ///< matches that agree with it: weight of the edge
};

}  // namespace twofold
