#include "mapping/window_builder.hpp"

#include <algorithm>
#include <cmath>

#include "camera/measurement.hpp"
#include "geometry/inverse_depth.hpp"
#include "imaging/guided_search.hpp"
#include "mapping/edges.hpp"
#include "mapping/mapper_hook.hpp"

namespace twofold {
namespace {

/// @param median_depth  of the keyframe that psi is relative to
bool plausible(const Vector3& psi, double median_depth, const MapperOptions& options) {
  return psi.allFinite() && psi.z() > options.min_inverse_depth &&
         options.nearest * median_depth * psi.z() < 1;
}

}  // namespace

WindowBuilder::WindowBuilder(const Rig& rig, const MapperOptions& options) : options_(options) {
  problem_.rig = rig;
}

void WindowBuilder::build(const GraphSnapshot& graph, const DoubleWindow& window) {
  problem_.poses.resize(window.nodes.size());
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    problem_.poses[n] = {graph.keyframe(window.nodes[n].id).T_k_w, false};
  }
  collect_points(graph, window);
  collect_observations(graph, window);
  collect_constraints(graph, window);
}

/// Chooses the frame a point is anchored in within the problem; false if the point has to stay out.
bool WindowBuilder::anchor_point(const GraphSnapshot& graph, const DoubleWindow& window, PointId id,
                                 int seen_from, WindowProblem::Point& point) const {
  const MapPoint& map_point = graph.point(id);
  const int anchor = window.position.find(map_point.anchor);
  if (anchor >= 0) {
    // Select_double_window let anchors join W2 for their points. An older member of W2 serves as well only
    // with a direct edge to W1.
    point.anchor = anchor;
    point.psi = map_point.psi;
    if (window.is_inner(anchor)) return true;
    for (const Edge& edge : *graph.keyframe(map_point.anchor).edges) {
      if (window.is_inner(edge.other)) return true;
    }
    return false;
  }
  // An anchor that was culled moves with its replacement. In the problem such a point hangs on a frame that
  // sees it.
  if (!graph.keyframe(map_point.anchor).culled()) return false;
  if (!window.contains(graph.live_replacement(map_point.anchor)->id)) return false;
  point.anchor = seen_from;
  const KeyframeId seen_from_id = window.nodes[static_cast<std::size_t>(seen_from)].id;
  const Keyframe& keyframe = graph.keyframe(seen_from_id);
  const SE3 T_k_a = keyframe.T_k_w * graph.T_k_w(map_point.anchor).inverse();
  point.psi = to_inverse_depth(T_k_a * from_inverse_depth(map_point.psi));
  return plausible(point.psi, keyframe.median_depth, options_);
}

void WindowBuilder::collect_points(const GraphSnapshot& graph, const DoubleWindow& window) {
  problem_.points.clear();
  point_ids_.clear();
  point_position_.clear();
  constexpr int kLeftOut = 0;  // position of the point in the problem + 1 otherwise
  for (std::size_t n = 0; n < window.inner; ++n) {
    for (const Observation& observation : *graph.keyframe(window.nodes[n].id).observations) {
      const PointId id = observation.point;
      if (point_position_.find(id) >= 0) continue;
      point_position_.set(id, kLeftOut);
      WindowProblem::Point point;
      if (!anchor_point(graph, window, id, static_cast<int>(n), point)) continue;
      problem_.points.push_back(point);
      point_ids_.push_back(id);
      point_position_.set(id, static_cast<int>(problem_.points.size()));
    }
  }
  positions_w_.clear();
  for (const auto& point : problem_.points) {
    const SE3& T_a_w = problem_.poses[static_cast<std::size_t>(point.anchor)].T_k_w;
    positions_w_.push_back(T_a_w.inverse() * from_inverse_depth(point.psi));
  }
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    for (const Observation& observation : *graph.keyframe(window.nodes[n].id).observations) {
      const int p = usable_point(observation.point, static_cast<int>(n));
      if (p >= 0) ++problem_.points[static_cast<std::size_t>(p)].observation_count;
    }
  }
  keep_best_points();
}

/// Points the window measures once are left out, and beyond the budget those it measures least.
void WindowBuilder::keep_best_points() {
  std::vector<std::size_t> with_count;
  for (const auto& point : problem_.points) {
    const auto count = static_cast<std::size_t>(point.observation_count);
    if (count >= with_count.size()) with_count.resize(count + 1);
    ++with_count[count];
  }
  const auto max_points = static_cast<std::size_t>(options_.max_points);
  std::size_t threshold = with_count.size(), kept = 0;  // points with more measurements are kept
  while (threshold > 2 && kept + with_count[threshold - 1] <= max_points) {
    kept += with_count[--threshold];
  }
  std::size_t room = max_points - std::min(kept, max_points);
  if (threshold <= 2) room = 0;
  std::size_t to = 0;
  int first = 0;
  for (std::size_t from = 0; from < problem_.points.size(); ++from) {
    const auto count = static_cast<std::size_t>(problem_.points[from].observation_count);
    const bool at_threshold = count + 1 == threshold && room > 0;
    if (count < threshold && !at_threshold) {
      point_position_.set(point_ids_[from], 0);
      continue;
    }
    if (count < threshold) --room;
    problem_.points[to] = problem_.points[from];
    positions_w_[to] = positions_w_[from];
    problem_.points[to].first_observation = first;
    first += problem_.points[to].observation_count;
    point_ids_[to] = point_ids_[from];
    ++to;
    point_position_.set(point_ids_[from], static_cast<int>(to));
  }
  problem_.points.resize(to);
  point_ids_.resize(to);
  problem_.observations.resize(static_cast<std::size_t>(first));
}

void WindowBuilder::collect_observations(const GraphSnapshot& graph, const DoubleWindow& window) {
  filled_.assign(problem_.points.size(), 0);
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    for (const Observation& observation : *graph.keyframe(window.nodes[n].id).observations) {
      add_observation(observation, static_cast<int>(n));
    }
  }
}

int WindowBuilder::usable_point(PointId id, int pose) const {
  const int p = point_position_.find(id) - 1;
  if (p < 0) return -1;
  const SE3& T_k_w = problem_.poses[static_cast<std::size_t>(pose)].T_k_w;
  return in_front_of_camera(T_k_w * positions_w_[static_cast<std::size_t>(p)]) ? p : -1;
}

void WindowBuilder::add_observation(const Observation& observation, int pose) {
  const int at = usable_point(observation.point, pose);
  if (at < 0) return;
  const auto p = static_cast<std::size_t>(at);
  auto& entry = problem_.observations[static_cast<std::size_t>(problem_.points[p].first_observation) +
                                      static_cast<std::size_t>(filled_[p]++)];
  entry.pose = pose;
  entry.pixel = observation.pixel;
  entry.information = problem_.rig.information(observation.pixel, observation.level);
}

void WindowBuilder::collect_constraints(const GraphSnapshot& graph, const DoubleWindow& window) {
  problem_.constraints.clear();
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    const Keyframe& from = graph.keyframe(window.nodes[n].id);
    for (const Edge& edge : *from.edges) {
      const int other = window.position.find(edge.other);
      if (other <= static_cast<int>(n)) continue;  // outside, or met from the other end
      const Keyframe& to = graph.keyframe(edge.other);
      // Within W1 the points speak, except across a loop that has been recognised but not yet matched.
      if (window.is_inner(other) &&
          (!edge.marginalised || shared_points(from, to) >= options_.min_covisible)) {
        continue;
      }
      WindowProblem::PoseConstraint constraint{static_cast<int>(n), other,
                                               relative_pose(graph, from.id, edge),
                                               edge_information(from, to, edge, problem_.rig, options_.edge)};
      if (options_.hook) options_.hook->constrain(graph, from, edge, point_position_, constraint);
      if (!constraint.information.isZero(0)) problem_.constraints.push_back(constraint);
    }
  }
}

void WindowBuilder::write_back(GraphWriter& writer, const DoubleWindow& window) const {
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    writer.set_pose(window.nodes[n].id, problem_.poses[n].T_k_w);
  }
  const GraphSnapshot& graph = writer.graph();
  for (std::size_t p = 0; p < point_ids_.size(); ++p) {
    const auto& solved = problem_.points[p];
    const auto used = static_cast<std::size_t>(solved.anchor);
    const KeyframeId anchor = graph.point(point_ids_[p]).anchor;
    // Near or not is asked where the problem has it: a culled anchor has no depths any more.
    if (!plausible(solved.psi, graph.keyframe(window.nodes[used].id).median_depth, options_)) continue;
    Vector3 psi = solved.psi;
    if (anchor != window.nodes[used].id) {
      writer.shorten_replacements(anchor);
      const SE3 T_a_used = graph.T_k_w(anchor) * problem_.poses[used].T_k_w.inverse();
      psi = to_inverse_depth(T_a_used * from_inverse_depth(psi));
    }
    if (psi.allFinite() && psi.z() > options_.min_inverse_depth) writer.set_inverse_depth(point_ids_[p], psi);
  }
}

void WindowBuilder::find_outliers(const DoubleWindow& window, std::vector<Outlier>& outliers) const {
  outliers.clear();
  for (std::size_t p = 0; p < point_ids_.size(); ++p) {
    const auto& point = problem_.points[p];
    const Vector3 x_w = position_w(problem_, point);
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& observation = problem_.observations[static_cast<std::size_t>(point.first_observation + n)];
      const double limit =
          weighs_right(observation.information) ? options_.outlier_chi2_stereo : options_.outlier_chi2_mono;
      if (observation_chi2(problem_, x_w, observation) <= limit) continue;
      outliers.push_back({window.nodes[static_cast<std::size_t>(observation.pose)].id, point_ids_[p]});
    }
  }
  std::sort(outliers.begin(), outliers.end());
}

}  // namespace twofold
