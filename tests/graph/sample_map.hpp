#pragma once

#include <algorithm>
#include <random>

#include "graph/graph_writer.hpp"
#include "graph/map_file.hpp"
#include "graph/part_extraction.hpp"

namespace twofold::testing {

/// A map with everything a file must hold: culled keyframes and points, both kinds of edges, missing right
/// coordinates.
inline SavedMap sample_map(int keyframes, int points, std::uint32_t seed) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> number(-1, 1);
  // One draw a statement: compilers evaluate arguments in orders of their own, and files of older formats
  // hold this map.
  const auto vector = [&] {
    const double z = number(rng);
    const double y = number(rng);
    const double x = number(rng);
    return Vector3(x, y, z);
  };
  const auto random_pose = [&] {
    const Vector3 translation = 10 * vector();
    return SE3(SO3::exp(vector()), translation);
  };
  GraphWriter writer;
  for (int k = 0; k < keyframes; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(k)};
    keyframe.frame_index = 7 * k;
    keyframe.t_ns = 1'700'000'000'000'000'000 + 33'333'333LL * k;
    keyframe.T_k_w = random_pose();
    keyframe.median_depth = 2 + number(rng);
    writer.add_keyframe(keyframe);
    for (int back = 1; back <= std::min(k, 3); ++back) {
      Edge edge;
      edge.other = KeyframeId{static_cast<std::uint32_t>(k - back)};
      edge.weight = 40 / back;
      edge.marginalised = back == 2;
      if (edge.marginalised) edge.T_other_this = random_pose();
      writer.set_edge(keyframe.id, edge);
    }
  }
  writer.set_reference(KeyframeId{static_cast<std::uint32_t>(keyframes - 1)});
  for (int p = 0; p < points; ++p) {
    const PointId id{static_cast<std::uint32_t>(p)};
    const auto anchor = static_cast<std::uint32_t>(p * keyframes / points);
    MapPoint point;
    point.anchor = KeyframeId{anchor};
    point.psi = vector();
    point.psi.z() = 0.6 + 0.4 * point.psi.z();
    auto appearance = std::make_shared<PointAppearance>();
    appearance->uv = {static_cast<float>(rng() % 640), static_cast<float>(rng() % 480)};
    appearance->level = static_cast<std::uint8_t>(rng() % 3);
    for (std::uint8_t& pixel : appearance->pixels) pixel = static_cast<std::uint8_t>(rng());
    point.appearance = appearance;
    writer.add_point(id, point);
    for (std::uint32_t k = anchor; k < std::min<std::uint32_t>(anchor + 3, keyframes); ++k) {
      const float u = static_cast<float>(rng() % 6400) / 10;
      const float right = p % 5 == 0 ? std::numeric_limits<float>::quiet_NaN() : u - 12;
      writer.add_observations(KeyframeId{k}, std::vector<Observation>{{id, {u, 100, right}, 1}});
    }
  }
  for (int p = 3; p < points; p += 11) writer.cull_point(PointId{static_cast<std::uint32_t>(p)});
  for (int k = 4; k + 2 < keyframes; k += 9) {
    writer.cull_keyframe(KeyframeId{static_cast<std::uint32_t>(k)},
                         KeyframeId{static_cast<std::uint32_t>(k + 1)});
  }
  SavedMap map;
  map.rig.camera = {500, 501, 320, 240, 640, 480};
  map.rig.baseline = 0.11;
  map.graph = writer.publish();
  for (int k = 0; k < keyframes; k += 2) {  // some were never described
    const KeyframeId id{static_cast<std::uint32_t>(k)};
    if (map.graph.keyframe(id).culled()) continue;
    PlaceAppearance place;
    for (int n = 0; n < 1 + k % 7; ++n) {
      DescribedCorner corner;
      corner.uv = {static_cast<float>(rng() % 640), static_cast<float>(rng() % 480)};
      corner.level = static_cast<std::uint8_t>(rng() % 3);
      corner.angle = 0.1F * static_cast<float>(rng() % 60);
      for (std::uint64_t& bits : corner.descriptor.bits) {
        bits = std::uint64_t{rng()} << 32;
        bits |= rng();
      }
      place.corners.push_back(corner);
      const float u_r = n % 3 == 0 ? std::numeric_limits<float>::quiet_NaN() : corner.uv.x() - 20;
      place.pixels.emplace_back(corner.uv.x(), corner.uv.y(), u_r);
    }
    map.places.set(id, std::move(place));
  }
  return map;
}

/// Two maps in one graph, the second one's numbers behind the first one's.
inline SavedMap two_parts(const SavedMap& first, const SavedMap& second) {
  GraphWriter writer(first.graph);
  SavedMap both = first;
  const auto keyframes = static_cast<std::uint32_t>(first.graph.keyframe_count());
  const auto points = static_cast<std::uint32_t>(first.graph.point_count());
  const auto shifted = [&](KeyframeId id) { return KeyframeId{index(id) + keyframes}; };
  for (std::uint32_t k = 0; k < second.graph.keyframe_count(); ++k) {
    Keyframe keyframe = second.graph.keyframe(KeyframeId{k});
    if (keyframe.culled()) {
      const Replacement& replacement = second.graph.replacement(KeyframeId{k});
      writer.add_culled_keyframe({shifted(replacement.id), 0, replacement.T_this_replacement});
      continue;
    }
    keyframe.id = shifted(keyframe.id);
    ObservationList observations = *keyframe.observations;
    for (Observation& o : observations) o.point = PointId{index(o.point) + points};
    keyframe.observations = std::make_shared<const ObservationList>(std::move(observations));
    EdgeList edges = *keyframe.edges;
    for (Edge& edge : edges) edge.other = shifted(edge.other);
    keyframe.edges = std::make_shared<const EdgeList>(std::move(edges));
    writer.add_keyframe(keyframe);
    if (const PlaceAppearance* place = second.places.find(KeyframeId{k}))
      both.places.set(keyframe.id, *place);
  }
  for (std::uint32_t p = 0; p < second.graph.point_count(); ++p) {
    MapPoint point = second.graph.point(PointId{p});
    if (point.culled()) continue;
    point.anchor = shifted(point.anchor);
    ObserverList observers = *point.observers;
    for (KeyframeId& observer : observers) observer = shifted(observer);
    point.observers = std::make_shared<const ObserverList>(std::move(observers));
    writer.add_point(PointId{p + points}, point);
  }
  writer.set_reference(shifted(second.graph.reference()));
  name_parts(writer);
  both.graph = writer.publish();
  return both;
}

}  // namespace twofold::testing
