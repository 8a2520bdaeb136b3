#pragma once

#include <vector>

#include "estimation/window_problem.hpp"
#include "graph/graph_writer.hpp"
#include "mapping/double_window.hpp"

namespace twofold {

/// The double window as a least-squares problem (eq. 6.4), and back into the graph. Buffers are kept between
/// rounds.
class WindowBuilder {
 public:
  explicit WindowBuilder(const Rig& rig) { problem_.rig = rig; }

  /// Fills the problem from the window: its poses, all points seen from W1 whose anchor is in the window or
  /// next to W1 (6.2.4; such anchors join W2), their measurements from W1 and W2, and a pose-pose constraint
  /// for every edge with an end in W2.
  WindowProblem& build(const GraphSnapshot& graph, DoubleWindow& window, const MapperOptions& options);

  /// Writes poses and points back, and removes measurements that the solution contradicts and points that are
  /// left with fewer than two. Returns how many measurements were removed.
  int write_back(GraphWriter& writer, const DoubleWindow& window, const MapperOptions& options) const;

  [[nodiscard]] const WindowProblem& problem() const { return problem_; }

 private:
  void collect_points(const GraphSnapshot& graph, DoubleWindow& window);
  [[nodiscard]] int anchor_position(const GraphSnapshot& graph, DoubleWindow& window,
                                    KeyframeId anchor) const;
  void collect_observations(const GraphSnapshot& graph, const DoubleWindow& window);
  void collect_constraints(const GraphSnapshot& graph, const DoubleWindow& window,
                           const MapperOptions& options);

  WindowProblem problem_;
  std::vector<PointId> points_;       // of the problem, by position
  std::vector<int> point_positions_;  // by point id; -1
  VisitedSet visited_;
};

/// Lambda of eq. 6.2 for an edge; see MapperOptions::constraint_share.
[[nodiscard]] Matrix6 edge_information(const Rig& rig, const Edge& edge, double depth, double share);

}  // namespace twofold
