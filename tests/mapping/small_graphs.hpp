#pragma once

#include <random>

#include "camera/rig.hpp"
#include "geometry/inverse_depth.hpp"
#include "graph/graph_writer.hpp"
#include "mapping/edges.hpp"

namespace twofold {

inline KeyframeId add_keyframe(GraphWriter& writer, const SE3& T_k_w, double median_depth = 1) {
  Keyframe keyframe;
  keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer.graph().keyframe_count())};
  keyframe.T_k_w = T_k_w;
  keyframe.median_depth = median_depth;
  writer.add_keyframe(keyframe);
  return keyframe.id;
}

/// A point seen from the given keyframes, anchored in the first, at its true place.
inline PointId add_point(GraphWriter& writer, const Rig& rig, const Vector3& x_w,
                         const std::vector<KeyframeId>& observers) {
  const PointId id{static_cast<std::uint32_t>(writer.graph().point_count())};
  MapPoint point;
  point.anchor = observers.front();
  point.psi = to_inverse_depth(writer.graph().T_k_w(observers.front()) * x_w);
  writer.add_point(id, point);
  for (const KeyframeId k : observers) {
    Observation observation;
    observation.point = id;
    observation.pixel = rig.project(writer.graph().T_k_w(k) * x_w).cast<float>();
    writer.add_observations(k, std::span(&observation, 1));
  }
  return id;
}

/// n keyframes in a row along x, one per `step` metres, looking along z; edges between neighbours.
inline GraphWriter chain(std::uint32_t n, double step = 0.1, int weight = 30) {
  GraphWriter writer;
  for (std::uint32_t k = 0; k < n; ++k) {
    add_keyframe(writer, SE3(SO3(), {-step * k, 0, 0}));
    if (k > 0) link(writer, KeyframeId{k - 1}, KeyframeId{k}, weight);
  }
  writer.set_reference(KeyframeId{n - 1});
  return writer;
}

}  // namespace twofold
