#pragma once

#include <optional>

#include "experiments/double_window/edge_measurements.hpp"
#include "experiments/double_window/map_unit.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold::bench {

/// What the mapper of an experiment does otherwise than that of the program.
struct ExperimentalMappingOptions {
  bool fixed_rim = false;       ///< W2's poses do not move: the hard rim the thesis argues against
  bool own_unit = false;        ///< lengths of the map are in a unit of its own (MapUnit); needs a stereo rig
  bool measured_edges = false;  ///< edges are made of measurements (EdgeMeasurements) where there are any
  double length_share = 0.05;   ///< see EdgeMeasurements
};

class ExperimentalMapping : public MapperHook {
 public:
  ExperimentalMapping(const Rig& rig, const MapperOptions& mapper, const ExperimentalMappingOptions& options);

  void graph_replaced() override;
  void edge_leaves(const GraphSnapshot& graph, const WindowProblem& solved, KeyframeId from,
                   KeyframeId to) override;
  void constrain(const GraphSnapshot& graph, const Keyframe& from, const Edge& edge, const IdMap& position,
                 WindowProblem::PoseConstraint& constraint) override;
  void before_solve(const DoubleWindow& window, WindowProblem& problem) override;
  void after_solve(const DoubleWindow& window, const WindowProblem& problem) override;
  void loop_closed(KeyframeId from, KeyframeId to) override;
  void keyframe_culled(KeyframeId id) override;

  /// Lengths of the graph times this are metres.
  [[nodiscard]] double metres_per_unit() const;

 private:
  Rig rig_;
  int min_covisible_;
  bool fixed_rim_;
  std::optional<MapUnit> unit_;
  std::optional<EdgeMeasurements> measurements_;
};

}  // namespace twofold::bench
