#pragma once

#include <optional>
#include <string>
#include <vector>

#include "graph/loop_constraint.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

struct ProbationOptions {
  double max_shift = 0.15;   ///< two loops agree up to so much of the scene's median depth ...
  double max_angle_deg = 6;  ///< ... and so much rotation
  int patience = 12;         ///< keyframe numbers after which a loop that nobody confirmed is dropped

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Holds a loop back until something else says the same, because a wrong one cannot be undone: the map as it
/// is, where both its keyframes are of one part, or a second keyframe whose own loop agrees along the map's
/// poses.
///
/// Loops l and m agree when  T_m.to,m.from  =  T_m.to,l.to  T_l.to,l.from  T_l.from,m.from  up to the bounds,
/// the outer two of the map.
class LoopProbation {
 public:
  explicit LoopProbation(const ProbationOptions& options) : options_(options) {}

  /// @param loop  verified between keyframes of `graph`; to be called in the order of loop.to
  /// @return whether it may join the map now; else it is held as a witness
  [[nodiscard]] bool confirms(const LoopConstraint& loop, const GraphSnapshot& graph);

 private:
  [[nodiscard]] bool agree(const LoopConstraint& held, const LoopConstraint& loop,
                           const GraphSnapshot& graph) const;
  [[nodiscard]] bool same_pose(const SE3& T_a, const SE3& T_b, double depth) const;

  ProbationOptions options_;
  std::vector<LoopConstraint> held_;
};

}  // namespace twofold
