#include "tracking/common/local_map.hpp"

#include "geometry/inverse_depth.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxAnchors = 512;
constexpr std::size_t kMaxEdges = 512;

}  // namespace

SE3 pose_in_world(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k) {
  SE3 T_k_here;
  for (const PendingKeyframe* pending = nullptr; !graph.contains(k); k = pending->reference) {
    pending = immature.find_pending(k);
    TWOFOLD_CHECK(pending != nullptr, "keyframe neither in the map nor pending");
    T_k_here = T_k_here * pending->T_k_ref;
    if (pending->reference == kNoKeyframe) return T_k_here;
  }
  return T_k_here * graph.T_k_w(k);
}

KeyframeId part_of(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k) {
  while (!graph.contains(k)) {
    const PendingKeyframe* pending = immature.find_pending(k);
    TWOFOLD_CHECK(pending != nullptr, "keyframe neither in the map nor pending");
    if (pending->reference == kNoKeyframe) return k;
    k = pending->reference;
  }
  return graph.part(k);
}

SE3 pose_relative_to(const GraphSnapshot& graph, const ImmaturePoints& immature, KeyframeId k,
                     KeyframeId ref) {
  if (k == ref) return {};
  return pose_in_world(graph, immature, k) * pose_in_world(graph, immature, ref).inverse();
}

LocalMap::LocalMap(std::size_t capacity) : met_(kTable, 0) {
  points_.reserve(capacity);
  anchors_.reserve(kMaxAnchors);
  neighbours_.reserve(kMaxEdges);
}

bool LocalMap::first_sight(PointId id) {
  const std::uint64_t entry = std::uint64_t{generation_} << 32 | index(id);
  std::size_t slot = (index(id) * std::size_t{2654435761U}) % kTable;
  while (met_[slot] >> 32 == generation_) {
    if (met_[slot] == entry) return false;
    slot = (slot + 1) % kTable;
  }
  met_[slot] = entry;
  ++met_count_;
  return true;
}

int LocalMap::anchor_position(const GraphSnapshot& graph, KeyframeId id, const ImmaturePoints& immature) {
  // Points of one keyframe stand together, and new anchors are few: the last ones are the likely ones.
  for (std::size_t i = anchors_.size(); i-- > 0;) {
    if (anchors_[i].id == id) return static_cast<int>(i);
  }
  if (anchors_.size() == anchors_.capacity()) return -1;
  const auto part = [&](KeyframeId k) { return part_of(graph, immature, k); };
  if (id != origin_.reference && part(id) != part(origin_.reference)) return -1;
  anchors_.push_back({id, pose_relative_to(graph, immature, origin_.reference, id)});
  return static_cast<int>(anchors_.size()) - 1;
}

void LocalMap::add_neighbour(const GraphSnapshot& graph, KeyframeId id, const ImmaturePoints& immature) {
  for (const Observation& observation : *graph.keyframe(id).observations) {
    if (points_.size() == points_.capacity() || met_count_ == kMaxMet) return;
    const MapPoint& point = graph.point(observation.point);
    if (point.culled() || !first_sight(observation.point)) continue;
    const int anchor = anchor_position(graph, point.anchor, immature);
    if (anchor < 0) continue;
    const SE3& T_ref_a = anchors_[static_cast<std::size_t>(anchor)].T_ref_a;
    points_.push_back({observation.point, -1, anchor, point.appearance.get(), point.psi,
                       T_ref_a * from_inverse_depth(point.psi)});
  }
}

void LocalMap::update(const GraphSnapshot& graph, KeyframeId reference, const ImmaturePoints& immature,
                      int max_neighbours) {
  const Origin origin{graph.version(), immature.revision(), reference};
  if (origin == origin_) return;
  origin_ = origin;
  rebuild(graph, immature, max_neighbours);
}

void LocalMap::rebuild(const GraphSnapshot& graph, const ImmaturePoints& immature, int max_neighbours) {
  const KeyframeId reference = origin_.reference;
  points_.clear();
  anchors_.clear();
  neighbours_.clear();
  ++generation_;
  met_count_ = 0;
  for (std::size_t i = 0; i < immature.points().size() && points_.size() < points_.capacity(); ++i) {
    const ImmaturePoint& point = immature.points()[i];
    const int anchor = anchor_position(graph, point.anchor, immature);
    if (anchor < 0) continue;
    const SE3& T_ref_a = anchors_[static_cast<std::size_t>(anchor)].T_ref_a;
    points_.push_back({point.id, static_cast<int>(i), anchor, &point.appearance, point.psi,
                       T_ref_a * from_inverse_depth(point.psi), point.ray_sigma});
  }
  reference_range_ = {0, points_.size()};
  if (!graph.contains(reference)) return;
  const EdgeList& edges = *graph.keyframe(reference).edges;
  if (edges.size() + 1 <= neighbours_.capacity()) {
    direct_neighbours(graph, reference, static_cast<std::size_t>(max_neighbours), neighbours_);
  } else {
    neighbours_.push_back(reference);
  }
  const std::size_t own = points_.size();
  for (const KeyframeId id : neighbours_) {
    add_neighbour(graph, id, immature);
    if (id == reference) reference_range_ = {own, points_.size()};
  }
}

}  // namespace twofold
