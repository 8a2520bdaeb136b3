#pragma once

#include <cstdint>
#include <vector>

#include "geometry/se3.hpp"

namespace twofold {

/// Where the (left, rectified) camera was at one time: p_w = T_w_c * p_c  [m].
struct TimedPose {
  std::int64_t t_ns = 0;
  SE3 T_w_c;
};

/// Poses in the order of time.
using Trajectory = std::vector<TimedPose>;

}  // namespace twofold
