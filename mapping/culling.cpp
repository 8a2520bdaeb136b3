#include "mapping/culling.hpp"

#include <algorithm>
#include <cmath>

#include "geometry/inverse_depth.hpp"
#include "imaging/view_change.hpp"
#include "mapping/edges.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMinObservers = 2;  // seen from one keyframe alone, a point ties nothing together

bool has_lost_its_anchor(const GraphSnapshot& graph, PointId id) {
  const Keyframe& anchor = graph.keyframe(graph.point(id).anchor);
  return !anchor.culled() && !find_observation(anchor, id);
}

/// n and the replacement still meet without the culled keyframe: directly, or in a common neighbour.
bool in_touch(const Keyframe& n, const Keyframe& replacement, KeyframeId culled) {
  if (find_edge(n, replacement.id)) return true;
  for (const Edge& edge : *n.edges) {
    if (edge.other != culled && find_edge(replacement, edge.other)) return true;
  }
  return false;
}

const Edge& strongest_edge(const Keyframe& keyframe) {
  return *std::max_element(keyframe.edges->begin(), keyframe.edges->end(), [](const Edge& a, const Edge& b) {
    return a.weight != b.weight ? a.weight < b.weight : b.other < a.other;
  });
}

/// Variances of links in a row add up.
int weight_in_series(double a, double b) {
  return a > 0 && b > 0 ? std::max(1, static_cast<int>(std::lround(a * b / (a + b)))) : 1;
}

/// Edges from the replacement to neighbours of `id` that reach it through `id` alone.
void keep_connected(GraphWriter& writer, KeyframeId id, KeyframeId replacement) {
  const GraphSnapshot& graph = writer.graph();
  const std::shared_ptr<const EdgeList> edges = graph.keyframe(id).edges;
  const Edge& to_replacement = *find_edge(graph.keyframe(id), replacement);
  const SE3 T_id_replacement = relative_pose(graph, id, to_replacement).inverse();
  for (const Edge& edge : *edges) {
    if (edge.other == replacement || in_touch(graph.keyframe(edge.other), graph.keyframe(replacement), id))
      continue;
    const SE3 T_other_replacement = relative_pose(graph, id, edge) * T_id_replacement;
    link_marginalised(writer, replacement, edge.other, weight_in_series(edge.weight, to_replacement.weight),
                      T_other_replacement);
  }
}

}  // namespace

int remove_outlier_observations(GraphWriter& writer, std::span<const WindowBuilder::Outlier> outliers) {
  std::vector<PointId> points, suspects;
  for (std::size_t n = 0; n < outliers.size(); ++n) {
    points.push_back(outliers[n].point);
    suspects.push_back(outliers[n].point);
    if (n + 1 < outliers.size() && outliers[n + 1].keyframe == outliers[n].keyframe) continue;
    writer.remove_observations(outliers[n].keyframe, points);
    points.clear();
  }
  int culled = 0;
  for (const PointId id : suspects) {
    const MapPoint& point = writer.graph().point(id);
    if (point.culled()) continue;
    if (point.observers->size() >= kMinObservers && !has_lost_its_anchor(writer.graph(), id)) continue;
    writer.cull_point(id);
    ++culled;
  }
  return culled;
}

bool is_redundant(const GraphSnapshot& graph, KeyframeId id, const CullingOptions& options) {
  const auto& observations = *graph.keyframe(id).observations;
  if (observations.empty()) return false;
  const auto total = static_cast<double>(observations.size());
  const int allowed = static_cast<int>(std::floor((1 - options.redundant_share) * total + 1e-9));
  int own = 0;  // points that others do not see well enough
  for (const Observation& observation : observations) {
    int others = 0;
    for (const KeyframeId observer : *graph.point(observation.point).observers) {
      if (observer == id) continue;
      if (find_observation(graph.keyframe(observer), observation.point)->level > observation.level) continue;
      if (++others == options.redundant_observers) break;
    }
    if (others < options.redundant_observers && ++own > allowed) return false;
  }
  return true;
}

int remove_keyframe(GraphWriter& writer, KeyframeId id, const DoubleWindow& window) {
  TWOFOLD_CHECK(!writer.graph().keyframe(id).edges->empty(),
                "a keyframe without neighbours has no replacement");
  const Edge to_replacement = strongest_edge(writer.graph().keyframe(id));
  const KeyframeId replacement = to_replacement.other;
  keep_connected(writer, id, replacement);
  // As after a loop, until the pose graph is optimised: nothing but the edge joins what is in the windows to
  // what is not.
  if (!window.contains(replacement)) {
    const SE3 T_replacement_id = relative_pose(writer.graph(), id, to_replacement);
    writer.set_pose(id, T_replacement_id.inverse() * writer.graph().keyframe(replacement).T_k_w);
  }
  const std::shared_ptr<const ObservationList> observations = writer.graph().keyframe(id).observations;
  writer.cull_keyframe(id, replacement);
  int culled = 0;
  for (const Observation& observation : *observations) {
    if (writer.graph().point(observation.point).observers->size() >= kMinObservers) continue;
    writer.cull_point(observation.point);
    ++culled;
  }
  return culled;
}

std::vector<KeyframeId> cull_redundant_keyframes(GraphWriter& writer, const DoubleWindow& window,
                                                 const CullingOptions& options, std::size_t inserted,
                                                 int& culled_points) {
  const std::size_t limit =
      static_cast<std::size_t>(options.max_keyframes) * std::max<std::size_t>(1, inserted);
  std::vector<KeyframeId> candidates, culled;
  const GraphSnapshot& graph = writer.graph();
  for (std::size_t n = 0; n < window.inner; ++n) candidates.push_back(window.nodes[n].id);
  std::sort(candidates.rbegin(), candidates.rend());
  for (const KeyframeId id : candidates) {
    if (culled.size() == limit) break;
    if (index(id) + static_cast<std::size_t>(options.keep_recent) >= graph.keyframe_count()) continue;
    if (id == graph.reference() || graph.keyframe(id).culled() || graph.keyframe(id).edges->empty()) continue;
    if (!is_redundant(graph, id, options)) continue;
    culled_points += remove_keyframe(writer, id, window);
    culled.push_back(id);
  }
  return culled;
}

int PointCuller::cull(GraphWriter& writer, KeyframeId newest, std::span<const PointId> points) const {
  const SimilarView view(rig_.camera, writer.graph().keyframe(newest).T_k_w,
                         {.border_px = options_.view_border_px,
                          .min_cosine = options_.min_view_cosine,
                          .max_scale_change = options_.max_scale_change});
  int culled = 0;
  for (const PointId id : points) {
    const MapPoint& point = writer.graph().point(id);
    if (point.culled() || point.observers->size() > kMinObservers) continue;
    if (std::binary_search(point.observers->begin(), point.observers->end(), newest)) {
      if (point.misses > 0) writer.set_misses(id, 0);
      continue;
    }
    const Vector3 anchor_w = writer.graph().T_k_w(point.anchor).inverse().translation();
    if (!view.find(writer.graph().position(id), anchor_w)) continue;
    const int misses = point.misses + 1;
    if (misses < options_.max_misses) {
      writer.set_misses(id, static_cast<std::uint8_t>(misses));
      continue;
    }
    writer.cull_point(id);
    ++culled;
  }
  return culled;
}

}  // namespace twofold
