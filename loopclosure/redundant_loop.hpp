#pragma once

#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/neighbourhood.hpp"
#include "graph/snapshot.hpp"
#include "graph/way_length.hpp"

namespace twofold {

struct RedundantLoopOptions {
  /// Along the graph's edges from loop.to to loop.from (way_length), >= 0. What lies that near is tied
  /// together by shared points, and by the metric closure (MetricLoopOptions::max_way_of_one_camera).
  double max_way = kWayOfOneUnit;
  int max_keyframes = 200;  ///< met while that way is looked for, >= 1: bounds its time
  /// By how much a loop may move the points in the image, root mean square, >= 0. Those that differ by less
  /// agree, for the metric closure, too (MetricLoopOptions::max_error_px).
  double max_shift_px = 1;
  /// Of the logarithm of the scale, >= 0: half of what a keyframe's own place leaves open
  /// (DriftOptions::placement_scale).
  double max_log_scale = 0.01;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Loops that tell the map nothing it does not know: their keyframes are joined by a short way along edges,
/// and the map has them where the loop has them, as exactly as points are measured.
///
/// One camera's loop costs a pose graph over all of its part (close_over_sim3). Who browses a place for long
/// recognises it with nearly every keyframe, and each of these pose graphs would spread the loop's error of
/// measurement over the map instead of taking drift out of it.
class RedundantLoops {
 public:
  RedundantLoops(const PinholeCamera& camera, const RedundantLoopOptions& options)
      : camera_(camera), options_(options) {}

  /// @param loop   between keyframes of `graph` that are not culled
  /// @param found  points that it rests on, in the frame of loop.from; outliers among them are left out
  [[nodiscard]] bool has(const LoopConstraint& loop, std::span<const MotionObservation> found,
                         const GraphSnapshot& graph);

 private:
  [[nodiscard]] bool moves_nothing(const LoopConstraint& loop, std::span<const MotionObservation> found,
                                   const GraphSnapshot& graph) const;
  [[nodiscard]] bool short_way(const LoopConstraint& loop, const GraphSnapshot& graph);

  PinholeCamera camera_;
  RedundantLoopOptions options_;
  VisitedSet visited_;
  std::vector<TreeNode> tree_;
  std::vector<double> ways_;  ///< to the members of tree_
};

}  // namespace twofold
