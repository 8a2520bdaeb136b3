#pragma once

#include <vector>

#include "experiments/double_window/drift_mapper.hpp"
#include "experiments/double_window/feeder.hpp"

namespace twofold::bench {

/// A place seen again after a large loop: points that the map has twice.
struct Recognition {
  SimilarityConstraint loop;
  std::vector<PointCopies> copies;

  [[nodiscard]] bool found() const { return loop.inliers > 0; }
};

/// Known association in place of appearance  (6.4.2).
class PlaceRecognition {
 public:
  PlaceRecognition(const Scene& scene, const Feeder& feeder) : scene_(scene), feeder_(feeder) {}

  /// The best match of the reference keyframe among those that see the same points and are topologically far.
  [[nodiscard]] Recognition look(const GraphSnapshot& graph);

 private:
  [[nodiscard]] Recognition match(const GraphSnapshot& graph, KeyframeId from, KeyframeId to) const;
  [[nodiscard]] std::vector<PointCopies> copies(const GraphSnapshot& graph, KeyframeId from,
                                                KeyframeId to) const;
  static void measure(const GraphSnapshot& graph, Recognition& found);

  const Scene& scene_;
  const Feeder& feeder_;
  VisitedSet visited_;
  std::vector<TreeNode> tree_;
};

}  // namespace twofold::bench
