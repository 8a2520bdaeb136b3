#pragma once

#include "camera/rig.hpp"
#include "estimation/window_problem.hpp"
#include "graph/id_map.hpp"
#include "graph/snapshot.hpp"
#include "mapping/double_window.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Where an experiment reaches into the rounds of a Mapper (MapperOptions::hook): to take problems out of it,
/// or to try other edges and other variables. Called on the mapper's thread; by default nothing happens.
class MapperHook {
 public:
  MapperHook() = default;
  virtual ~MapperHook() = default;
  MapperHook(const MapperHook&) = delete;
  MapperHook& operator=(const MapperHook&) = delete;

  /// Whether the unit of one camera drifts, so that its loops are closed over Sim(3); if not, over SE(3).
  /// Also called on the loop closer's thread.
  [[nodiscard]] virtual bool scale_drifts() const { return true; }
  /// The mapper goes on with another graph.
  virtual void graph_replaced() {}
  /// An edge leaves W1.
  /// @param solved  the problem of the last round; the graph's points are as it left them
  virtual void edge_leaves([[maybe_unused]] const GraphSnapshot& graph,
                           [[maybe_unused]] const WindowProblem& solved, [[maybe_unused]] KeyframeId from,
                           [[maybe_unused]] KeyframeId to) {}
  /// May change a pose-pose constraint, which is that of eq. 6.2; with information 0 it is left out.
  /// @param edge      as seen from `from`
  /// @param position  position + 1 of a point in the problem; 0 or none: it is left out
  virtual void constrain([[maybe_unused]] const GraphSnapshot& graph, [[maybe_unused]] const Keyframe& from,
                         [[maybe_unused]] const Edge& edge, [[maybe_unused]] const IdMap& position,
                         [[maybe_unused]] WindowProblem::PoseConstraint& constraint) {}
  /// The problem as the joint optimisation starts from it, and as that leaves it. Pose n is window.nodes[n].
  virtual void before_solve([[maybe_unused]] const DoubleWindow& window,
                            [[maybe_unused]] WindowProblem& problem) {}
  virtual void after_solve([[maybe_unused]] const DoubleWindow& window,
                           [[maybe_unused]] const WindowProblem& problem) {}
  /// A recognised loop is the constraint of this edge now.
  virtual void loop_closed([[maybe_unused]] KeyframeId from, [[maybe_unused]] KeyframeId to) {}
  virtual void keyframe_culled([[maybe_unused]] KeyframeId id) {}
};

/// Whether a map's unit of length drifts: that of one camera does, unless an experiment says otherwise.
[[nodiscard]] inline bool scale_drifts(const Rig& rig, const MapperOptions& options) {
  return rig.kind == SensorKind::kMono && (!options.hook || options.hook->scale_drifts());
}

}  // namespace twofold
