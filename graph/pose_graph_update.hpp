#pragma once

#include <cstdint>
#include <vector>

#include "geometry/sim3.hpp"
#include "graph/ids.hpp"

namespace twofold {

struct KeyframePose {
  KeyframeId id = kNoKeyframe;
  SE3 T_k_w;
};

/// Message to the mapper: poses of one component of the map's graph that agree with all its edges. They are
/// as good as the version they were computed from, and their world frame is their own.
struct PoseGraphUpdate {
  std::uint64_t snapshot_version = 0;
  std::vector<KeyframePose> poses;  ///< first: the keyframe that was fixed
};

struct KeyframeSimilarity {
  KeyframeId id = kNoKeyframe;
  Sim3 S_k_w;  ///< its scale: by how much too long lengths around the keyframe are in the map as it was
};

/// Message to the mapper before a loop whose scale is not one: where keyframes are in the world of `part`
/// when the loop is closed over Sim(3)  (thesis 5.3.2, 6.2.7). The keyframe that came back stays as it is,
/// with its unit: nobody who tracks against it notices.
struct SimilarityUpdate {
  std::uint64_t snapshot_version = 0;
  KeyframePose fixed;             ///< the keyframe that came back
  KeyframeId part = kNoKeyframe;  ///< that all belong to from now on
  std::vector<KeyframeSimilarity> poses;
};

}  // namespace twofold
