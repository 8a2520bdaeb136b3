#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

struct ProbationOptions {
  double max_shift = 0.15;   ///< two loops agree up to so much of the scene's median depth ...
  double max_angle_deg = 6;  ///< ... and so much rotation
  double max_scale = 0.05;   ///< ... and so much of the logarithm of the scale
  int patience = 12;         ///< keyframe numbers after which a loop that nobody confirmed is dropped
  // What a loop may correct, by the way since its first keyframe. Distances are counted in median depths: by
  // that much a camera drifts alike in any scene.
  double slack = 0.3;      ///< shift that needs no way: keyframes may be placed badly
  double slack_deg = 15;   ///< likewise rotation
  double max_drift = 0.1;  ///< shift per distance travelled, besides what follows from scale and rotation
  double max_turn_drift = 0.03;               ///< rotation per rotation since
  double max_turn_drift_of_one_camera = 0.3;  ///< whose focal length may be wrong by a fifth
  double max_scale_drift = 0.02;  ///< of one camera: logarithm of the scale per distance travelled

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Holds a loop back until something else says the same, because a wrong one cannot be undone: the map as it
/// is, where both its keyframes are of one part, or a second keyframe whose own loop agrees along the map's
/// poses.
///
/// Loops l and m agree when  S_m.to,m.from  =  S_m.to,l.to  S_l.to,l.from  S_l.from,m.from  up to the bounds,
/// the outer two of the map, of scale 1.
///
/// What a loop corrects is bounded by the way between its keyframes: a loop that says more is taken for a
/// place that looks alike, as houses of a street do. A scale s and a rotation by w that drifted evenly along
/// a way d shift its end by (|log s| + |w|) d / 2. With one camera a loop may be of any scale within its
/// bound.
class LoopProbation {
 public:
  LoopProbation(SensorKind sensor, const ProbationOptions& options)
      : scale_drifts_(sensor == SensorKind::kMono), options_(options) {}

  /// @param loop  verified between keyframes of `graph`; to be called in the order of loop.to
  /// @return whether it may join the map now; else it is held as a witness
  [[nodiscard]] bool confirms(const LoopConstraint& loop, const GraphSnapshot& graph);

 private:
  [[nodiscard]] bool agree(const LoopConstraint& held, const LoopConstraint& loop,
                           const GraphSnapshot& graph) const;
  [[nodiscard]] bool same_pose(const Sim3& S_a, const Sim3& S_b, double depth) const;
  [[nodiscard]] bool explained_by_drift(const Sim3& as_mapped, const LoopConstraint& loop,
                                        const GraphSnapshot& graph) const;

  bool scale_drifts_;
  ProbationOptions options_;
  std::vector<LoopConstraint> held_;
};

}  // namespace twofold
