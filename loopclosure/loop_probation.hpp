#pragma once

#include <optional>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "graph/loop_constraint.hpp"
#include "graph/snapshot.hpp"
#include "loopclosure/drift_model.hpp"

namespace twofold {

struct ProbationOptions {
  double max_shift = 0.15;   ///< two loops agree up to so much of the scene's median depth, > 0 ...
  double max_angle_deg = 6;  ///< ... and so much rotation, > 0
  double max_scale = 0.05;   ///< ... and so much of the logarithm of the scale, > 0
  int patience = 12;         ///< keyframe numbers after which a loop that nobody confirmed is dropped, >= 1
  DriftOptions drift;        ///< what a loop may correct

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// T_to_from along the map's poses; none if the keyframes are of different parts, or forgotten.
[[nodiscard]] std::optional<SE3> pose_in_map(const GraphSnapshot& graph, KeyframeId to, KeyframeId from);

/// Holds a loop back until something else says the same, because a wrong one cannot be undone: the map as it
/// is, where both its keyframes are of one part, or a second keyframe whose own loop agrees along the map's
/// poses.
///
/// Loops l and m agree when  S_m.to,m.from  =  S_m.to,l.to  S_l.to,l.from  S_l.from,m.from  up to the bounds,
/// the outer two of the map, of scale 1.
///
/// Two things speak against a loop, as in a street whose houses look alike. It corrects more than the way
/// between its keyframes can have drifted. Or the images of the last keyframes, this one's included, show
/// places that cannot be one: by loops l and m, S_m.from,l.from is not what the map says, and the way between
/// the two places does not explain it either. Then looks do not tell places apart here, and the map alone is
/// a witness.
class LoopProbation {
 public:
  LoopProbation(SensorKind sensor, const ProbationOptions& options)
      : drift_(sensor, options.drift), options_(options) {}

  /// @param loop  verified between keyframes of `graph`; to be called in the order of loop.to
  /// @return whether it may join the map now; else it is held as a witness
  [[nodiscard]] bool confirms(const LoopConstraint& loop, const GraphSnapshot& graph);
  /// A loop too rough to join the map or to speak for another one: it only shows which places look alike.
  void hold(const LoopConstraint& loop);

  /// Whether the map has two of its keyframes elsewhere to each other than p_b = S_b_a * p_a, and the way
  /// between them does not explain it. Of two parts it says nothing.
  [[nodiscard]] bool contradicts(KeyframeId b, KeyframeId a, const Sim3& S_b_a,
                                 const GraphSnapshot& graph) const;

 private:
  struct Held {
    LoopConstraint loop;
    bool witness;  ///< not rough, and explained by drift; else it only shows that places look alike
  };

  void end_patience(KeyframeId now);
  [[nodiscard]] bool agree(const LoopConstraint& held, const LoopConstraint& loop,
                           const GraphSnapshot& graph) const;
  [[nodiscard]] bool exclude_each_other(const LoopConstraint& held, const LoopConstraint& loop,
                                        const GraphSnapshot& graph) const;
  [[nodiscard]] bool same_pose(const Sim3& S_a, const Sim3& S_b, double depth) const;

  DriftModel drift_;
  ProbationOptions options_;
  std::vector<Held> held_;
};

}  // namespace twofold
