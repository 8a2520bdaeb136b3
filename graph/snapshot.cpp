#include "graph/snapshot.hpp"

#include <algorithm>

#include "geometry/check.hpp"
#include "geometry/inverse_depth.hpp"

namespace twofold {

std::optional<GraphSnapshot::Survivor> GraphSnapshot::survivor(KeyframeId id) const {
  Survivor survivor{id, SE3()};
  while (keyframe(survivor.id).culled()) {
    const Heir& next = heir(survivor.id);
    if (next.id == kNoKeyframe) return std::nullopt;
    survivor = {next.id, survivor.T_this_survivor * next.T_this_heir.unpacked()};
  }
  return survivor;
}

SE3 GraphSnapshot::T_k_w(KeyframeId id) const {
  const Keyframe& keyframe = this->keyframe(id);
  if (!keyframe.culled()) return keyframe.T_k_w;
  const auto survivor = this->survivor(id);
  TWOFOLD_CHECK(survivor, "the pose of a keyframe that was culled and forgotten");
  return survivor->T_this_survivor * this->keyframe(survivor->id).T_k_w;
}

KeyframeId GraphSnapshot::part(KeyframeId id) const {
  const auto survivor = this->survivor(id);
  return survivor ? keyframe(survivor->id).part : kNoKeyframe;
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
