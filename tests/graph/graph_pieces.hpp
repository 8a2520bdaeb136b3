#pragma once

#include "graph/graph_writer.hpp"

namespace twofold::testing {

/// The next keyframe, without measurements.
inline KeyframeId add_keyframe(GraphWriter& writer, const SE3& T_k_w = SE3()) {
  Keyframe keyframe;
  keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer.graph().keyframe_count())};
  keyframe.T_k_w = T_k_w;
  writer.add_keyframe(keyframe);
  return keyframe.id;
}

inline MapPoint anchored_in(KeyframeId anchor) {
  MapPoint point;
  point.anchor = anchor;
  return point;
}

inline Edge edge_to(KeyframeId other, int weight) {
  Edge edge;
  edge.other = other;
  edge.weight = weight;
  return edge;
}

inline Observation seen(std::uint32_t point, float u = 0) {
  Observation observation;
  observation.point = PointId{point};
  observation.pixel = {u, 0, 0};
  return observation;
}

}  // namespace twofold::testing
