#include "mapping/window_builder.hpp"

#include <algorithm>
#include <cmath>

#include "imaging/guided_search.hpp"

namespace twofold {

Matrix6 edge_information(const Rig& rig, const Edge& edge, double depth, double share) {
  const double lambda_rot = share * rig.camera.fx;
  const double lambda_trans = lambda_rot / std::max(depth, 1e-3);
  Vector6 diagonal;
  diagonal << Vector3::Constant(lambda_trans * lambda_trans), Vector3::Constant(lambda_rot * lambda_rot);
  return (edge.weight * diagonal).asDiagonal();
}

WindowProblem& WindowBuilder::build(const GraphSnapshot& graph, DoubleWindow& window,
                                    const MapperOptions& options) {
  problem_.poses.clear();
  problem_.points.clear();
  problem_.observations.clear();
  problem_.constraints.clear();
  collect_points(graph, window);
  for (std::size_t n = 0; n < window.members().size(); ++n)
    problem_.poses.push_back({window.start_pose(n), false});
  collect_observations(graph, window);
  collect_constraints(graph, window, options);
  return problem_;
}

/// Position of a point's anchor; joins it to W2 when it only has an edge into W1. -1: the point must be left
/// out.
int WindowBuilder::anchor_position(const GraphSnapshot& graph, DoubleWindow& window,
                                   KeyframeId anchor) const {
  if (window.in_inner(anchor)) return window.position(anchor);
  int parent = -1;
  int weight = 0;
  for (const Edge& edge : *graph.keyframe(anchor).edges) {
    if (window.in_inner(edge.other) && edge.weight > weight) {
      parent = window.position(edge.other);
      weight = edge.weight;
    }
  }
  if (parent < 0) return -1;
  const int position = window.position(anchor);
  return position >= 0 ? position : window.add_anchor(graph, anchor, parent);
}

void WindowBuilder::collect_points(const GraphSnapshot& graph, DoubleWindow& window) {
  for (const PointId id : points_) point_positions_[index(id)] = -1;
  points_.clear();
  if (point_positions_.size() < graph.point_count()) point_positions_.resize(graph.point_count(), -1);
  std::vector<KeyframeId> inner;
  for (std::size_t n = 0; n < window.inner_count(); ++n) inner.push_back(window.members()[n].id);
  std::vector<PointId> visible;
  visible_points(graph, inner, visited_, visible);
  for (const PointId id : visible) {
    const MapPoint& point = graph.point(id);
    if (point.observers->size() < 2) continue;
    const int anchor = anchor_position(graph, window, point.anchor);
    if (anchor < 0) continue;
    point_positions_[index(id)] = static_cast<int>(points_.size());
    points_.push_back(id);
    problem_.points.push_back({anchor, point.psi, 0, 0});
  }
}

void WindowBuilder::collect_observations(const GraphSnapshot& graph, const DoubleWindow& window) {
  // Twice over the keyframes' lists: first how many measurements each point has, then each into its place.
  const auto for_each = [&](auto&& use) {
    for (std::size_t n = 0; n < window.members().size(); ++n) {
      for (const Observation& observation : *graph.keyframe(window.members()[n].id).observations) {
        const int p = point_positions_[index(observation.point)];
        if (p >= 0) use(static_cast<int>(n), problem_.points[static_cast<std::size_t>(p)], observation);
      }
    }
  };
  for_each([](int, WindowProblem::Point& point, const Observation&) { ++point.observation_count; });
  int total = 0;
  for (WindowProblem::Point& point : problem_.points) {
    point.first_observation = total;
    total += point.observation_count;
    point.observation_count = 0;
  }
  problem_.observations.resize(static_cast<std::size_t>(total));
  for_each([&](int pose, WindowProblem::Point& point, const Observation& observation) {
    const bool has_right = !std::isnan(observation.z.z());
    const auto at = static_cast<std::size_t>(point.first_observation + point.observation_count++);
    problem_.observations[at] = {pose, observation.z,
                                 measurement_information(problem_.rig, observation.level, has_right)};
  });
}

void WindowBuilder::collect_constraints(const GraphSnapshot& graph, const DoubleWindow& window,
                                        const MapperOptions& options) {
  for (std::size_t n = window.inner_count(); n < window.members().size(); ++n) {
    const Keyframe& keyframe = graph.keyframe(window.members()[n].id);
    for (const Edge& edge : *keyframe.edges) {
      const int other = window.position(edge.other);
      if (other < 0) continue;
      const bool outer = static_cast<std::size_t>(other) >= window.inner_count();
      if (outer && edge.other < keyframe.id) continue;  // met from the other end
      problem_.constraints.push_back(
          {static_cast<int>(n), other, relative_pose(graph, keyframe.id, edge),
           edge_information(problem_.rig, edge, keyframe.median_depth, options.constraint_share)});
    }
  }
}

int WindowBuilder::write_back(GraphWriter& writer, const DoubleWindow& window,
                              const MapperOptions& options) const {
  for (std::size_t n = 0; n < window.members().size(); ++n) {
    writer.set_pose(window.members()[n].id, problem_.poses[n].T_k_w);
  }
  std::vector<std::vector<PointId>> outliers(window.members().size());
  int removed = 0;
  for (std::size_t p = 0; p < points_.size(); ++p) {
    const WindowProblem::Point& point = problem_.points[p];
    int kept = 0;
    for (int o = 0; o < point.observation_count; ++o) {
      const auto& observation = problem_.observations[static_cast<std::size_t>(point.first_observation + o)];
      const double limit =
          observation.information.z() > 0 ? options.outlier_chi2_stereo : options.outlier_chi2_mono;
      if (observation_chi2(problem_, point, observation) <= limit) {
        ++kept;
      } else {
        outliers[static_cast<std::size_t>(observation.pose)].push_back(points_[p]);
        ++removed;
      }
    }
    const auto outside =
        static_cast<int>(writer.graph().point(points_[p]).observers->size()) - point.observation_count;
    if (kept + outside < 2 || !(point.psi.z() > 0)) {
      writer.cull_point(points_[p]);
    } else {
      writer.set_inverse_depth(points_[p], point.psi);
    }
  }
  for (std::size_t n = 0; n < outliers.size(); ++n) {
    if (outliers[n].empty()) continue;
    std::sort(outliers[n].begin(), outliers[n].end());
    writer.remove_observations(window.members()[n].id, outliers[n]);
  }
  return removed;
}

}  // namespace twofold
