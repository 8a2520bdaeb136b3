#include "experiments/double_window/place_recognition.hpp"

#include <algorithm>

#include "geometry/absolute_orientation.hpp"

namespace twofold::bench {
namespace {

constexpr std::size_t kNear = 60;  // keyframes within this topological distance are no large loop
constexpr int kMinMatches = 40;    // of a place that is recognised

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
  return best;
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
    found.matches.push_back(feeder_.observe(old, sighting.z));
  }
  if (static_cast<int>(x_from.size()) < kMinMatches) return found;
  const auto S_to_from = align_similarity(x_to, x_from);
  if (!S_to_from) return found;
  found.loop = {from, to, *S_to_from, static_cast<int>(x_from.size())};
  std::sort(found.matches.begin(), found.matches.end(),
            [](const Observation& a, const Observation& b) { return a.point < b.point; });
  return found;
}

}  // namespace twofold::bench
