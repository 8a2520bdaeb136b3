#include "graph/snapshot.hpp"

#include <algorithm>

#include "base/check.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

std::optional<GraphSnapshot::LiveReplacement> GraphSnapshot::live_replacement(KeyframeId id) const {
  LiveReplacement live_replacement{id, SE3()};
  while (keyframe(live_replacement.id).culled()) {
    const Replacement& next = replacement(live_replacement.id);
    if (next.id == kNoKeyframe) return std::nullopt;
    live_replacement = {next.id, live_replacement.T_this_live * next.T_this_replacement.unpacked()};
  }
  return live_replacement;
}

SE3 GraphSnapshot::T_k_w(KeyframeId id) const {
  const Keyframe& keyframe = this->keyframe(id);
  if (!keyframe.culled()) return keyframe.T_k_w;
  const auto live_replacement = this->live_replacement(id);
  TWOFOLD_CHECK(live_replacement, "the pose of a keyframe that was culled and forgotten");
  return live_replacement->T_this_live * this->keyframe(live_replacement->id).T_k_w;
}

KeyframeId GraphSnapshot::part(KeyframeId id) const {
  const auto live_replacement = this->live_replacement(id);
  return live_replacement ? keyframe(live_replacement->id).part : kNoKeyframe;
}

Vector3 GraphSnapshot::position(PointId id) const {
  const MapPoint& point = this->point(id);
  return T_k_w(point.anchor).inverse() * from_inverse_depth(point.psi);
}

const Observation* find_observation(const Keyframe& keyframe, PointId point) {
  if (!keyframe.observations) return nullptr;
  const ObservationList& list = *keyframe.observations;
  const auto it = std::lower_bound(list.begin(), list.end(), point,
                                   [](const Observation& o, PointId p) { return o.point < p; });
  return it != list.end() && it->point == point ? &*it : nullptr;
}

const Edge* find_edge(const Keyframe& keyframe, KeyframeId other) {
  if (!keyframe.edges) return nullptr;
  const EdgeList& list = *keyframe.edges;
  const auto it = std::lower_bound(list.begin(), list.end(), other,
                                   [](const Edge& e, KeyframeId k) { return e.other < k; });
  return it != list.end() && it->other == other ? &*it : nullptr;
}

SE3 relative_pose(const GraphSnapshot& graph, KeyframeId from, const Edge& edge) {
  if (edge.marginalised) return edge.T_other_this;
  return graph.keyframe(edge.other).T_k_w * graph.keyframe(from).T_k_w.inverse();
}

}  // namespace twofold
