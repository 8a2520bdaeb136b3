#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/types.hpp"
#include "graph/ids.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

using ObserverList = std::vector<KeyframeId>;  ///< ascending

/// Anchored inverse depth point  (thesis 6.2.4): Euclidean position in the anchor's frame is Pi(psi).
struct MapPoint {
  /// kNoKeyframe: the point was culled. The anchor itself may be a culled keyframe, because the
  /// point's appearance is how it looked from there: its frame is then known through its replacement, for as
  /// long as the point lives. Ask GraphSnapshot::T_k_w for its pose.
  KeyframeId anchor = kNoKeyframe;
  /// Keyframes in a row that should have seen it and did not: by this the mapper tells points that add
  /// nothing. Not saved.
  std::uint8_t misses = 0;
  Vector3 psi{0, 0, 1};
  std::shared_ptr<const PointAppearance> appearance;
  std::shared_ptr<const ObserverList> observers;

  [[nodiscard]] bool culled() const { return anchor == kNoKeyframe; }
};

}  // namespace twofold
