#pragma once

#include <cstdint>
#include <vector>

#include "geometry/se3.hpp"
#include "graph/ids.hpp"

namespace twofold {

struct KeyframePose {
  KeyframeId id = kNoKeyframe;
  SE3 T_k_w;
};

/// Message to the mapper: poses of one connected part of the map that agree with all its edges. They are as
/// good as the version they were computed from, and their world frame is their own.
struct PoseGraphUpdate {
  std::uint64_t snapshot_version = 0;
  std::vector<KeyframePose> poses;  ///< first: the keyframe that was fixed
};

}  // namespace twofold
