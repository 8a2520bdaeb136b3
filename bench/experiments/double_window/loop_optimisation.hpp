#pragma once

#include <vector>

#include "geometry/sim3.hpp"
#include "mapping/double_window.hpp"

namespace twofold::bench {

/// Both keyframes see the same place; the maps around them may differ in scale  (6.4.2).
struct SimilarityConstraint {
  KeyframeId from = kNoKeyframe;
  KeyframeId to = kNoKeyframe;
  Sim3 S_to_from;
  int inliers = 0;
};

/// Two points of the map that are one in the world.
struct PointCopies {
  PointId recent = kNoPoint, old = kNoPoint;
};

/// What a large loop may change.
enum class LoopGroup {
  kSim3,  ///< rotation, translation and scale  (6.2.7)
  kSe3    ///< rotation and translation; the scale the loop has measured is thrown away
};

/// Poses S_k_w of a window that a loop lies in as a whole, by window position: its misfit is spread along it
/// by pose graph optimisation over the group, constraints weighted by the identity  (thesis 5.3.2). The
/// loop's `from` stays.
[[nodiscard]] std::vector<Sim3> optimise_loop(const GraphSnapshot& graph, const DoubleWindow& window,
                                              const SimilarityConstraint& loop, LoopGroup group);

}  // namespace twofold::bench
