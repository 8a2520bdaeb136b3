#pragma once

#include <optional>
#include <random>

#include "graph/snapshot.hpp"
#include "tracking/common/placement.hpp"

namespace twofold {

/// Where to look for a camera that is said to be somewhere in a map made before: there first, then at poses
/// drawn from how uncertain that is, one after the other. The same for the same map and pose.
///
/// No allocation.
class AssumedPlacements {
 public:
  /// A search takes a millisecond or two.
  static constexpr int kTriesAFrame = 4;

  /// None.
  AssumedPlacements() = default;
  /// Relative to the keyframe of the pose's part from which the way there is the shortest.
  AssumedPlacements(const GraphSnapshot& graph, const AssumedPose& assumed);

  /// The next one; nothing when enough were tried.
  [[nodiscard]] std::optional<Placement> next();

 private:
  Placement assumed_;
  double position_sigma_ = 0, angle_sigma_ = 0;
  int left_ = 0;
  bool first_ = true;
  std::mt19937 rng_;  // any seed: the same each time
};

}  // namespace twofold
