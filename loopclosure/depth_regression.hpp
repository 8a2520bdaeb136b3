#pragma once

#include <optional>
#include <vector>

#include "camera/rig.hpp"
#include "graph/place_appearance.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// Depths where one camera measures none: of image positions near map points  (thesis 5.3.1).
///
/// k-nearest-neighbour regression: the inverse depth of a corner is the mean of the map points seen nearest
/// to it, weighted by their distance, if they are near enough and about equally deep: across an edge of depth
/// the mean says nothing. As the map is now: a corner's depth follows every change of the map's unit.
class DepthRegression {
 public:
  explicit DepthRegression(const PinholeCamera& camera) : camera_(camera) {}

  /// Forgets what it knew, and learns the points that keyframe k, which must not be culled, observes.
  void learn(const GraphSnapshot& graph, KeyframeId k);

  /// @param uv  level-0 pixels
  /// @return    depth in the map's unit
  [[nodiscard]] std::optional<double> depth_at(const Vector2& uv) const;

  /// view.z as a second camera at `baseline` to the right would have measured it; NaN where the depth is not
  /// known.
  void fill(PlaceAppearance& view, double baseline) const;

 private:
  struct Sample {
    Vector2 uv;
    double inverse_depth;
  };

  PinholeCamera camera_;
  std::vector<Sample> samples_;
};

}  // namespace twofold
