#pragma once

#include <cstdint>

#include "geometry/sim3.hpp"
#include "graph/ids.hpp"

namespace twofold {

/// Message of the loop closer to the mapper: both keyframes see the same place  (thesis 6.4.2).
struct LoopConstraint {
  std::uint64_t snapshot_version = 0;  ///< version it was computed from
  KeyframeId from = kNoKeyframe;
  KeyframeId to = kNoKeyframe;
  SE3 T_to_from;    ///< verified geometrically, in the unit of `to` [m]
  int inliers = 0;  ///< matches that agree with it
  int weight = 1;   ///< of the edge, >= 1: the inliers, each as far as its point's position is known
  double scale =
      1;  ///< lengths around `to` over the same around `from`. 1 but for one camera, whose unit drifts

  [[nodiscard]] Sim3 S_to_from() const { return {scale, T_to_from.so3(), T_to_from.translation()}; }
};

}  // namespace twofold
