#pragma once

#include <algorithm>
#include <random>

#include "graph/graph_writer.hpp"
#include "graph/map_file.hpp"
#include "graph/part_extraction.hpp"

namespace twofold::testing {

/// Draws a map part by part. Files of older formats hold what it drew: the order of draws is theirs, one a
/// statement, since compilers evaluate arguments in orders of their own.
class SampleMapMaker {
 public:
  SampleMapMaker(int keyframes, int points, std::uint32_t seed)
      : keyframes_(keyframes), points_(points), rng_(seed) {}

  SavedMap make() {
    for (int k = 0; k < keyframes_; ++k) add_keyframe(k);
    writer_.set_reference(id_of(keyframes_ - 1));
    for (int p = 0; p < points_; ++p) add_point(p);
    cull_some();
    SavedMap map;
    map.rig.camera = {500, 501, 320, 240, 640, 480};
    map.rig.baseline = 0.11;
    map.graph = writer_.publish();
    for (int k = 0; k < keyframes_; k += 2)  // some were never described
      if (!map.graph.keyframe(id_of(k)).culled()) map.places.set(id_of(k), draw_place(1 + k % 7));
    return map;
  }

 private:
  static KeyframeId id_of(int k) { return KeyframeId{static_cast<std::uint32_t>(k)}; }

  Vector3 draw_vector() {
    const double z = number_(rng_);
    const double y = number_(rng_);
    const double x = number_(rng_);
    return {x, y, z};
  }

  SE3 draw_pose() {
    const Vector3 translation = 10 * draw_vector();
    return SE3(SO3::exp(draw_vector()), translation);
  }

  void add_keyframe(int k) {
    Keyframe keyframe;
    keyframe.id = id_of(k);
    keyframe.frame_index = 7 * k;
    keyframe.t_ns = 1'700'000'000'000'000'000 + 33'333'333LL * k;
    keyframe.T_k_w = draw_pose();
    keyframe.median_depth = 2 + number_(rng_);
    writer_.add_keyframe(keyframe);
    for (int back = 1; back <= std::min(k, 3); ++back) {
      Edge edge;
      edge.other = id_of(k - back);
      edge.weight = 40 / back;
      edge.marginalised = back == 2;
      if (edge.marginalised) edge.T_other_this = draw_pose();
      writer_.set_edge(keyframe.id, edge);
    }
  }

  void add_point(int p) {
    const PointId id{static_cast<std::uint32_t>(p)};
    const int anchor = p * keyframes_ / points_;
    MapPoint point;
    point.anchor = id_of(anchor);
    point.psi = draw_vector();
    point.psi.z() = 0.6 + 0.4 * point.psi.z();
    auto appearance = std::make_shared<PointAppearance>();
    appearance->uv = {static_cast<float>(rng_() % 640), static_cast<float>(rng_() % 480)};
    appearance->level = static_cast<std::uint8_t>(rng_() % 3);
    for (std::uint8_t& pixel : appearance->pixels) pixel = static_cast<std::uint8_t>(rng_());
    point.appearance = appearance;
    writer_.add_point(id, point);
    for (int k = anchor; k < std::min(anchor + 3, keyframes_); ++k) {
      const float u = static_cast<float>(rng_() % 6400) / 10;
      const float right = p % 5 == 0 ? std::numeric_limits<float>::quiet_NaN() : u - 12;
      writer_.add_observations(id_of(k), std::vector<Observation>{{id, {u, 100, right}, 1}});
    }
  }

  void cull_some() {
    for (int p = 3; p < points_; p += 11) writer_.cull_point(PointId{static_cast<std::uint32_t>(p)});
    for (int k = 4; k + 2 < keyframes_; k += 9) writer_.cull_keyframe(id_of(k), id_of(k + 1));
  }

  PlaceAppearance draw_place(int corners) {
    PlaceAppearance place;
    for (int n = 0; n < corners; ++n) {
      DescribedCorner corner;
      corner.uv = {static_cast<float>(rng_() % 640), static_cast<float>(rng_() % 480)};
      corner.level = static_cast<std::uint8_t>(rng_() % 3);
      corner.angle = 0.1F * static_cast<float>(rng_() % 60);
      for (std::uint64_t& bits : corner.descriptor.bits) {
        bits = std::uint64_t{rng_()} << 32;
        bits |= rng_();
      }
      place.corners.push_back(corner);
      const float u_r = n % 3 == 0 ? std::numeric_limits<float>::quiet_NaN() : corner.uv.x() - 20;
      place.pixels.emplace_back(corner.uv.x(), corner.uv.y(), u_r);
    }
    return place;
  }

  const int keyframes_, points_;
  std::mt19937 rng_;
  std::uniform_real_distribution<double> number_{-1, 1};
  GraphWriter writer_;
};

/// A map with everything a file must hold: culled keyframes and points, both kinds of edges, missing right
/// coordinates.
inline SavedMap sample_map(int keyframes, int points, std::uint32_t seed) {
  return SampleMapMaker(keyframes, points, seed).make();
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
