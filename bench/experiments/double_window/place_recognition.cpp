#include "experiments/double_window/place_recognition.hpp"

#include <algorithm>
#include <set>

#include "geometry/absolute_orientation.hpp"
#include "graph/neighbourhood.hpp"

namespace twofold::bench {
namespace {

constexpr std::size_t kNear = 60;  // keyframes within this topological distance are no large loop
constexpr int kMinMatches = 30;    // of a place that is recognised: Theta, "typically 15 to 30"

}  // namespace

Recognition PlaceRecognition::look(const GraphSnapshot& graph) {
  Recognition best;
  const KeyframeId k = graph.reference();
  weighted_breadth_first(graph, k, kNear, visited_, tree_);
  for (const int earlier : scene_.covisible[index(k)]) {
    const KeyframeId j{static_cast<std::uint32_t>(earlier)};
    if (std::any_of(tree_.begin(), tree_.end(), [&](const TreeNode& n) { return n.id == j; })) continue;
    Recognition found = match(graph, k, j);
    if (found.loop.inliers > best.loop.inliers) best = std::move(found);
  }
  if (best.found()) {
    best.copies = copies(graph, k, best.loop.to);
    measure(graph, best);
  }
  return best;
}

/// The similarity from all points that the map has twice: the neighbourhoods' scale, not one keyframe's.
void PlaceRecognition::measure(const GraphSnapshot& graph, Recognition& found) {
  std::vector<Vector3> x_from, x_to;
  for (const PointCopies& pair : found.copies) {
    x_from.push_back(graph.T_k_w(found.loop.from) * graph.position(pair.recent));
    x_to.push_back(graph.T_k_w(found.loop.to) * graph.position(pair.old));
  }
  if (const auto S_to_from = align_similarity(x_to, x_from)) found.loop.S_to_from = *S_to_from;
}

/// Of all that the neighbourhoods N1 of both keyframes see.
std::vector<PointCopies> PlaceRecognition::copies(const GraphSnapshot& graph, KeyframeId from,
                                                  KeyframeId to) const {
  const auto neighbourhood = [&](KeyframeId keyframe) {
    std::vector<KeyframeId> near;
    direct_neighbours(graph, keyframe, graph.keyframe_count(), near);
    std::sort(near.begin(), near.end());
    return near;
  };
  const std::vector<KeyframeId> near_from = neighbourhood(from), near_to = neighbourhood(to);
  const auto seen_from = [&graph](const std::vector<KeyframeId>& near) {
    return [&graph, &near](PointId id) {
      if (!graph.contains(id) || graph.point(id).culled()) return false;
      const ObserverList& observers = *graph.point(id).observers;
      return std::any_of(observers.begin(), observers.end(), [&](KeyframeId observer) {
        return std::binary_search(near.begin(), near.end(), observer);
      });
    };
  };
  std::set<int> sighted;
  for (const KeyframeId keyframe : near_from) {
    for (const Scene::Sighting& s : scene_.seen[index(keyframe)]) sighted.insert(s.point);
  }
  std::vector<PointCopies> result;
  for (const int world : sighted) {
    const PointId recent = feeder_.map_point(world, seen_from(near_from));
    const PointId old = feeder_.map_point(world, seen_from(near_to));
    if (recent != kNoPoint && old != kNoPoint && recent != old) result.push_back({recent, old});
  }
  return result;
}

Recognition PlaceRecognition::match(const GraphSnapshot& graph, KeyframeId from, KeyframeId to) const {
  Recognition found;
  std::vector<Vector3> x_from, x_to;
  const auto seen_by = [&](KeyframeId keyframe) {
    return [&graph, keyframe](PointId id) {
      return graph.contains(id) && find_observation(graph.keyframe(keyframe), id) != nullptr;
    };
  };
  for (const Scene::Sighting& sighting : scene_.seen[index(from)]) {
    const PointId recent = feeder_.map_point(sighting.point, seen_by(from));
    const PointId old = feeder_.map_point(sighting.point, seen_by(to));
    if (recent == kNoPoint || old == kNoPoint || recent == old) continue;
    x_from.push_back(graph.T_k_w(from) * graph.position(recent));
    x_to.push_back(graph.T_k_w(to) * graph.position(old));
  }
  if (static_cast<int>(x_from.size()) < kMinMatches) return found;
  const auto S_to_from = align_similarity(x_to, x_from);
  if (!S_to_from) return found;
  found.loop = {from, to, *S_to_from, static_cast<int>(x_from.size())};
  return found;
}

}  // namespace twofold::bench
