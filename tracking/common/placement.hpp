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

/// Where one camera was in a frame between the first keyframe and the one in which its start was found.
struct EarlierFrame {
  std::int64_t frame_index = 0;
  SE3 T_c_first;
};

}  // namespace twofold
