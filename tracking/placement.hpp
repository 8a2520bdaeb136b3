#pragma once

#include "geometry/se3.hpp"
#include "graph/ids.hpp"

namespace twofold {

/// Where the camera is.
struct Placement {
  KeyframeId reference = kNoKeyframe;
  SE3 T_c_ref;
};

}  // namespace twofold
