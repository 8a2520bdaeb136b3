#include "graph/map_entries.hpp"

#include <algorithm>
#include <cmath>

namespace twofold::map_format {
namespace {

std::shared_ptr<const ObservationList> take_observations(EntryReader& in) {
  constexpr std::size_t kBytes = 4 + 3 * 4 + 1;
  auto list = std::make_shared<ObservationList>(in.count(kBytes));
  for (std::size_t n = 0; n < list->size(); ++n) {
    Observation& observation = (*list)[n];
    observation.point = PointId{in.u32()};
    for (int i = 0; i < 3; ++i) observation.pixel[i] = in.number<float>();
    observation.level = in.small(kLevels, "pyramid level");
    if (!std::isfinite(observation.pixel.x()) || !std::isfinite(observation.pixel.y()) ||
        std::isinf(observation.pixel.z())) {
      throw MalformedBytes("holds a measurement that is not finite");
    }
    if (n > 0 && !((*list)[n - 1].point < observation.point))
      throw MalformedBytes("observations out of order");
  }
  return list;
}

void take_state(EntryReader& in, Keyframe& keyframe) {
  keyframe.frame_index = in.number<std::int64_t>();
  keyframe.t_ns = in.number<std::int64_t>();
  keyframe.T_k_w = in.pose();
  keyframe.median_depth = in.finite();
}

EdgeList take_edges(EntryReader& in, KeyframeId id) {
  constexpr std::size_t kBytes = 4 + 4 + 1 + 7 * 8 + 8;
  EdgeList list(in.count(kBytes));
  for (std::size_t n = 0; n < list.size(); ++n) {
    Edge& edge = list[n];
    edge.other = KeyframeId{in.u32()};
    edge.weight = in.number<std::int32_t>();
    edge.marginalised = in.small(2, "flag") != 0;
    edge.T_other_this = in.pose();
    (void)in.finite();  // a number that older programs kept with an edge
    if (!(edge.other < id)) throw MalformedBytes("holds an edge to a keyframe that is not there");
    if (n > 0 && !(list[n - 1].other < edge.other)) throw MalformedBytes("edges out of order");
    if (edge.weight < 0) throw MalformedBytes("holds an edge of negative weight");
  }
  return list;
}

}  // namespace

Rig take_rig(EntryReader& in) {
  Rig rig;
  rig.kind = static_cast<SensorKind>(in.small(3, "kind of sensor"));
  PinholeCamera& c = rig.camera;
  for (double* value : {&c.fx, &c.fy, &c.cx, &c.cy}) *value = in.finite();
  c.width = in.number<std::int32_t>();
  c.height = in.number<std::int32_t>();
  if (c.width < 1 || c.height < 1 || !(c.fx > 0) || !(c.fy > 0))
    throw MalformedBytes("holds an impossible camera");
  for (double* value : {&rig.baseline, &rig.depth_unit, &rig.depth_min, &rig.depth_max}) {
    *value = in.finite();
  }
  return rig;
}

KeyframeEntry take_keyframe(EntryReader& in, KeyframeId id) {
  KeyframeEntry entry;
  entry.id = id;
  switch (static_cast<EntryKind>(in.small(3, "kind of keyframe"))) {
    case EntryKind::kForgotten:
      break;
    case EntryKind::kCulled:
      entry.replacement.id = KeyframeId{in.u32()};
      entry.replacement.T_this_replacement = PackedPose(in.pose());
      if (entry.forgotten()) throw MalformedBytes("holds a culled keyframe without a replacement");
      break;
    case EntryKind::kKeyframe:
      entry.keyframe.id = id;
      take_state(in, entry.keyframe);
      entry.keyframe.observations = take_observations(in);
      entry.edges = take_edges(in, id);
      break;
  }
  return entry;
}

KeyframeEntry take_keyframe_1(EntryReader& in, KeyframeId id) {
  KeyframeEntry entry;
  entry.id = id;
  take_state(in, entry.keyframe);
  entry.replacement.id = KeyframeId{in.u32()};
  entry.replacement.T_this_replacement = PackedPose(in.pose());
  entry.keyframe.observations = take_observations(in);
  entry.edges = take_edges(in, id);
  if (entry.replacement.id == kNoKeyframe) entry.keyframe.id = id;
  return entry;
}

MapPoint take_point(EntryReader& in) {
  MapPoint point;
  point.anchor = KeyframeId{in.u32()};
  if (point.culled()) return point;
  point.psi = in.vector3();
  if (in.small(2, "flag") == 0) return point;
  auto appearance = std::make_shared<PointAppearance>();
  for (int i = 0; i < 2; ++i) appearance->uv[i] = in.number<float>();
  appearance->level = in.small(kLevels, "pyramid level");
  if (!appearance->uv.allFinite()) throw MalformedBytes("holds a position that is not finite");
  const auto pixels = in.take(appearance->pixels.size());
  std::copy(pixels.begin(), pixels.end(), appearance->pixels.begin());
  point.appearance = std::move(appearance);
  return point;
}

PlaceAppearance take_place(EntryReader& in, const Rig& rig) {
  constexpr std::size_t kBytes = 3 * 4 + 1 + 4 + sizeof(BinaryDescriptor);
  PlaceAppearance place;
  place.corners.resize(in.count(kBytes));
  if (rig.kind != SensorKind::kMono) place.pixels.reserve(place.corners.size());
  for (DescribedCorner& corner : place.corners) {
    for (int i = 0; i < 2; ++i) corner.uv[i] = in.number<float>();
    const auto u_r = in.number<float>();
    corner.level = in.small(kLevels, "pyramid level");
    corner.angle = in.number<float>();
    for (std::uint64_t& bits : corner.descriptor.bits) bits = in.u64();
    const bool inside = corner.uv.x() >= 0 && corner.uv.x() < static_cast<float>(rig.camera.width) &&
                        corner.uv.y() >= 0 && corner.uv.y() < static_cast<float>(rig.camera.height);
    if (!inside) throw MalformedBytes("holds a corner outside of the image");
    if (!std::isfinite(corner.angle) || std::isinf(u_r))
      throw MalformedBytes("holds a number that is not finite");
    if (rig.kind != SensorKind::kMono) place.pixels.emplace_back(corner.uv.x(), corner.uv.y(), u_r);
  }
  return place;
}

}  // namespace twofold::map_format
