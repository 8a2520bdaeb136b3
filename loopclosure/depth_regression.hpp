#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "graph/place_appearance.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// Which map points say how deep a corner is.
struct DepthRegressionOptions {
  double max_distance_share = 0.04;  ///< of the image's width: a farther point says nothing, in (0, 1]
  double max_depth_ratio = 1.25;     ///< of the points asked; beyond there is an edge between them, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Depths where one camera measures none: of image positions near map points  (thesis 5.3.1).
///
/// k-nearest-neighbour regression: the inverse depth of a corner is the mean of the map points seen nearest
/// to it, weighted by their distance, if they are near enough and about equally deep: across an edge of depth
/// the mean says nothing. As the map is now: a corner's depth follows every change of the map's unit.
class DepthRegression {
 public:
  explicit DepthRegression(const PinholeCamera& camera, const DepthRegressionOptions& options = {});

  /// Forgets what it knew, and learns the points that keyframe k, which must not be culled, observes.
  void learn(const GraphSnapshot& graph, KeyframeId k);

  /// @param uv  level-0 pixels
  /// @return    depth in the map's unit
  [[nodiscard]] std::optional<double> depth_at(const Vector2& uv) const;

  /// Sets view.pixels as if a second camera stood at `baseline` to the right; without a right coordinate
  /// where the depth is not known.
  void fill(PlaceAppearance& view, double baseline) const;

 private:
  struct Sample {
    Vector2 uv;
    double inverse_depth;
  };

  [[nodiscard]] Eigen::Array2i cell_of(const Eigen::Array2d& uv) const;

  PinholeCamera camera_;
  DepthRegressionOptions options_;
  double reach_;                 ///< how far a point may be [px]
  double cell_;                  ///< side of a cell [px]: a search meets nine at most
  Eigen::Array2i cells_;         ///< columns and rows of the image
  std::vector<Sample> samples_;  ///< by cell, row by row
  std::vector<int> begin_;       ///< of each cell's samples, and the end of the last
  std::vector<Sample> unsorted_;
};

}  // namespace twofold
