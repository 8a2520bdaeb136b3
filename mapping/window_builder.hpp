#pragma once

#include <vector>

#include "estimation/window_problem.hpp"
#include "graph/graph_writer.hpp"
#include "graph/id_map.hpp"
#include "mapping/double_window.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Translates between the graph and the optimisation problem of eq. 6.4. Buffers are kept between rounds.
///
/// Pose n of the problem is window.nodes[n]. Points are those seen from W1 whose anchor is at hand (6.2.4)
/// and which the window observes at least twice; observations of them from the outer window are included. An
/// observation of a point that starts behind the camera has no useful gradient and is left out of the round.
/// Pose-pose constraints are the edges with an end in W2 and both ends in the double window.
class WindowBuilder {
 public:
  WindowBuilder(const Rig& rig, const MapperOptions& options);

  void build(const GraphSnapshot& graph, const DoubleWindow& window);
  [[nodiscard]] WindowProblem& problem() { return problem_; }
  [[nodiscard]] const WindowProblem& problem() const { return problem_; }
  [[nodiscard]] const std::vector<PointId>& point_ids() const { return point_ids_; }

  /// Poses and points of the solved problem go back into the graph.
  void write_back(GraphWriter& writer, const DoubleWindow& window) const;

  struct Outlier {
    KeyframeId keyframe = kNoKeyframe;
    PointId point = kNoPoint;
    auto operator<=>(const Outlier&) const = default;  // NOLINT(modernize-use-nullptr): there is no 0 here
  };
  /// Observations the solved problem disagrees with, by keyframe, then point.
  void find_outliers(const DoubleWindow& window, std::vector<Outlier>& outliers) const;

 private:
  void collect_points(const GraphSnapshot& graph, const DoubleWindow& window);
  void keep_best_points();
  void collect_observations(const GraphSnapshot& graph, const DoubleWindow& window);
  /// Position in the problem of a point that is in front of the pose; -1 for others.
  [[nodiscard]] int usable_point(PointId id, int pose) const;
  void add_observation(const Observation& observation, int pose);
  void collect_constraints(const GraphSnapshot& graph, const DoubleWindow& window);
  [[nodiscard]] bool anchor_point(const GraphSnapshot& graph, const DoubleWindow& window, PointId id,
                                  int seen_from, WindowProblem::Point& point) const;

  MapperOptions options_;
  WindowProblem problem_;
  std::vector<PointId> point_ids_;
  IdMap point_position_;
  std::vector<Vector3> positions_w_;  ///< of the points at the start
  std::vector<int> filled_;
};

}  // namespace twofold
