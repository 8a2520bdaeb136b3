#pragma once

#include <cstdint>

#include "geometry/se3.hpp"
#include "graph/ids.hpp"

namespace twofold {

/// Where the camera is.
struct Placement {
  KeyframeId reference = kNoKeyframe;
  SE3 T_c_ref;
};

/// Where the camera is said to be in a map made before.
struct AssumedPose {
  KeyframeId part = kNoKeyframe;  ///< whose world that is; kNoKeyframe: the oldest's
  SE3 T_w_c;
  double position_sigma = 0;  ///< standard deviation of each coordinate [m], >= 0
  double angle_sigma = 0;     ///< about each axis [rad], >= 0
};

/// Where one camera was in a frame between the first keyframe and the one in which its start was found.
struct EarlierFrame {
  std::int64_t frame_index = 0;
  SE3 T_c_first;
};

}  // namespace twofold
