#include "slam/map_snapshot.hpp"

#include <algorithm>

#include "graph/part_extraction.hpp"
#include "graph/point_covariance.hpp"
#include "imaging/guided_search.hpp"
#include "slam/conversions.hpp"

namespace twofold {
namespace {

const std::shared_ptr<const MapSnapshot::Impl>& empty_map() {
  static const auto kEmpty =
      std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{{}, std::make_shared<const MapVersion>()});
  return kEmpty;
}

/// Calls visit(keyframe) for those that were not culled, ascending.
template <class Visit>
void for_each_keyframe(const GraphSnapshot& graph, const Visit& visit) {
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (!keyframe.culled()) visit(keyframe);
  }
}

// What the heap and a count of uses take of a block beside its values, and the tree of a PersistentVector of
// an entry.
constexpr std::size_t kBlock = 48;
constexpr std::size_t kEntry = 40;

/// Of `count` values in one block of the heap.
template <class T>
std::size_t block_bytes(std::size_t count) {
  return count == 0 ? 0 : kBlock + count * sizeof(T);
}

template <class List>
std::size_t shared_list_bytes(const List& list) {
  return block_bytes<List>(1) + block_bytes<typename List::value_type>(list.capacity());
}

}  // namespace

MapSnapshot::MapSnapshot() : impl_(empty_map()) {}
MapSnapshot::MapSnapshot(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}
MapSnapshot::MapSnapshot(const MapSnapshot&) = default;
MapSnapshot& MapSnapshot::operator=(const MapSnapshot&) = default;
MapSnapshot::MapSnapshot(MapSnapshot&& other) noexcept : impl_(std::exchange(other.impl_, empty_map())) {}
MapSnapshot& MapSnapshot::operator=(MapSnapshot&& other) noexcept {
  impl_ = std::exchange(other.impl_, empty_map());
  return *this;
}
MapSnapshot::~MapSnapshot() = default;

std::uint64_t MapSnapshot::version() const {
  return impl_->map->graph.version();
}

std::uint32_t MapSnapshot::reference() const {
  return index(impl_->map->graph.reference());
}

std::optional<MapSnapshot::CameraPose> MapSnapshot::camera_pose(const PoseEstimate& estimate) const {
  if (estimate.state != TrackingState::kTracked) return std::nullopt;
  auto pose = keyframe_pose(estimate.reference_keyframe);
  if (pose) pose->T_world_camera = compose(pose->T_world_camera, estimate.T_reference_camera);
  return pose;
}

std::optional<MapSnapshot::CameraPose> MapSnapshot::keyframe_pose(std::uint32_t id) const {
  const GraphSnapshot& graph = impl_->map->graph;
  const KeyframeId keyframe{id};
  if (!graph.contains(keyframe) || !graph.live_replacement(keyframe)) return std::nullopt;
  return CameraPose{index(graph.part(keyframe)), to_pose(graph.T_k_w(keyframe).inverse())};
}

std::vector<MapSnapshot::Keyframe> MapSnapshot::keyframes() const {
  const MapVersion& map = *impl_->map;
  std::vector<std::uint8_t> window(map.graph.keyframe_count(), 0);
  const auto mark = [&](const std::vector<KeyframeId>& members, std::uint8_t number) {
    for (const KeyframeId member : members) {
      if (map.graph.contains(member)) window[index(member)] = number;
    }
  };
  mark(map.outer_window, 2);
  mark(map.inner_window, 1);
  std::vector<Keyframe> keyframes;
  for_each_keyframe(map.graph, [&](const twofold::Keyframe& from) {
    Keyframe& keyframe = keyframes.emplace_back();
    keyframe.id = index(from.id);
    keyframe.part = index(from.part);
    keyframe.frame = from.frame_index;
    keyframe.t_ns = from.t_ns;
    keyframe.T_world_camera = to_pose(from.T_k_w.inverse());
    keyframe.points = static_cast<std::uint32_t>(from.observations->size());
    keyframe.window = window[index(from.id)];
    keyframe.has_place = map.places.find(from.id) != nullptr;
    keyframe.loaded = keyframe.id < impl_->loaded_keyframes;
  });
  return keyframes;
}

std::vector<MapSnapshot::Point> MapSnapshot::points(bool with_covariance) const {
  const GraphSnapshot& graph = impl_->map->graph;
  std::vector<Point> points;
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    const MapPoint& from = graph.point(PointId{p});
    if (from.culled()) continue;
    Point& point = points.emplace_back();
    point.id = p;
    point.anchor = index(from.anchor);
    point.part = index(graph.part(from.anchor));
    point.observers = static_cast<std::uint32_t>(from.observers->size());
    Eigen::Map<Vector3>(point.position.data()) = graph.position(PointId{p});
    const auto covariance = with_covariance ? point_covariance(impl_->rig, graph, PointId{p}) : std::nullopt;
    if (covariance) Eigen::Map<Matrix3>(point.covariance.data()) = *covariance;
  }
  return points;
}

std::vector<MapSnapshot::Edge> MapSnapshot::edges() const {
  const GraphSnapshot& graph = impl_->map->graph;
  std::vector<Edge> edges;
  for_each_keyframe(graph, [&](const twofold::Keyframe& from) {
    for (const twofold::Edge& edge : *from.edges) {
      if (edge.other < from.id) continue;  // both ends list it
      edges.push_back({index(from.id), index(edge.other),
                       edge.marginalised ? EdgeKind::kMarginalised : EdgeKind::kCovisible,
                       static_cast<std::uint32_t>(edge.weight),
                       to_pose(relative_pose(graph, from.id, edge))});
    }
  });
  return edges;
}

std::vector<MapSnapshot::Loop> MapSnapshot::loops() const {
  std::vector<Loop> loops;
  const auto& closed = impl_->map->loops;
  for (std::size_t n = 0; n < closed.size(); ++n) {
    const ClosedLoop& from = closed[n];
    Loop& loop = loops.emplace_back();
    loop.from = index(from.constraint.from);
    loop.to = index(from.constraint.to);
    loop.t_ns = from.t_ns;
    loop.inliers = from.constraint.inliers;
    loop.scale = from.constraint.scale;
    loop.joins_parts = from.joins_parts;
    if (from.joins_parts) continue;
    const SE3 drift = from.drift();
    loop.drift = drift.translation().norm();
    loop.turned = drift.so3().log().norm();
    loop.travelled = from.travelled;
  }
  return loops;
}

std::vector<MapSnapshot::Part> MapSnapshot::parts() const {
  const GraphSnapshot& graph = impl_->map->graph;
  std::vector<Part> parts;
  for (const KeyframeId id : parts_of(graph)) parts.push_back({index(id), 0});
  for_each_keyframe(graph, [&](const twofold::Keyframe& keyframe) {
    const auto part = std::lower_bound(parts.begin(), parts.end(), index(keyframe.part),
                                       [](const Part& p, std::uint32_t id) { return p.id < id; });
    ++part->keyframes;
  });
  return parts;
}

std::size_t MapSnapshot::memory_bytes() const {
  const MapVersion& map = *impl_->map;
  const GraphSnapshot& graph = map.graph;
  std::size_t bytes = sizeof map + map.loops.size() * (kEntry + sizeof(ClosedLoop)) +
                      block_bytes<KeyframeId>(map.inner_window.capacity()) +
                      block_bytes<KeyframeId>(map.outer_window.capacity());
  // Culled ones stand in their chunks beside others, and have a replacement for a while.
  bytes += graph.keyframe_count() * (kEntry + sizeof(twofold::Keyframe) + sizeof(Replacement)) +
           graph.point_count() * (kEntry + sizeof(MapPoint)) +
           map.places.size() * (kEntry + sizeof(std::shared_ptr<const PlaceAppearance>));
  for_each_keyframe(graph, [&](const twofold::Keyframe& keyframe) {
    bytes += shared_list_bytes(*keyframe.observations) + shared_list_bytes(*keyframe.edges);
    if (const PlaceAppearance* place = map.places.find(keyframe.id)) {
      bytes += block_bytes<PlaceAppearance>(1) + block_bytes<DescribedCorner>(place->corners.capacity()) +
               block_bytes<StereoPixelF>(place->pixels.capacity());
    }
  });
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    const MapPoint& point = graph.point(PointId{p});
    if (!point.culled()) bytes += block_bytes<PointAppearance>(1) + shared_list_bytes(*point.observers);
  }
  return bytes;
}

}  // namespace twofold
