// Maps as the page gets them.
#include <algorithm>
#include <cmath>

#include "viewer/scene.hpp"

namespace twofold {
namespace {

/// The covariance's largest eigenvalue is at most its trace, and at least a third of it.
std::uint8_t code_of(const std::array<double, 9>& covariance) {
  return deviation_code(std::sqrt(covariance[0] + covariance[4] + covariance[8]));
}

ViewKeyframe view_of(const MapSnapshot::Keyframe& keyframe, std::int64_t start_ns) {
  ViewKeyframe view;
  view.id = keyframe.id;
  view.part = keyframe.part;
  if (!keyframe.loaded) {  // else it was there from the first moment on
    view.frame = static_cast<std::uint32_t>(keyframe.frame);
    view.t = static_cast<float>(1e-9 * static_cast<double>(keyframe.t_ns - start_ns));
  }
  std::copy_n(keyframe.T_world_camera.t.begin(), 3, view.position);
  std::copy_n(keyframe.T_world_camera.q.begin(), 4, view.orientation);
  view.points = keyframe.points;
  view.window = keyframe.window;
  view.has_place = keyframe.has_place ? 1 : 0;
  return view;
}

ViewPoint view_of(const MapSnapshot::Point& point) {
  ViewPoint view;
  view.id = point.id;
  std::copy_n(point.position.begin(), 3, view.position);
  view.part = point.part;
  view.anchor = point.anchor;
  view.observers = static_cast<std::uint8_t>(std::min<std::uint32_t>(point.observers, 255));
  view.deviation = code_of(point.covariance);
  return view;
}

ViewEdge view_of(const MapSnapshot::Edge& edge) {
  ViewEdge view;
  view.from = edge.from;
  view.to = edge.to;
  view.shared_points = static_cast<std::uint16_t>(std::min<std::uint32_t>(edge.shared_points, 0xffff));
  view.marginalised = edge.kind == MapSnapshot::EdgeKind::kMarginalised ? 1 : 0;
  return view;
}

/// The one with the greatest id up to `id`, which stands for it when it is gone; else the first. Keyframes
/// are not none.
std::uint32_t standing_for(std::uint32_t id, const std::vector<ViewKeyframe>& keyframes) {
  const auto after =
      std::upper_bound(keyframes.begin(), keyframes.end(), id,
                       [](std::uint32_t k, const ViewKeyframe& keyframe) { return k < keyframe.id; });
  return (after == keyframes.begin() ? after : std::prev(after))->id;
}

}  // namespace

void mark_loops(const std::vector<MapSnapshot::Loop>& loops, ViewMap& view) {
  if (view.keyframes.empty()) return;
  for (const MapSnapshot::Loop& loop : loops) {
    const auto [from, to] =
        std::minmax({standing_for(loop.from, view.keyframes), standing_for(loop.to, view.keyframes)});
    if (from == to) continue;
    ViewEdge edge{.from = from, .to = to};
    const auto at = std::lower_bound(view.edges.begin(), view.edges.end(), edge,
                                     [](const ViewEdge& a, const ViewEdge& b) { return a.key() < b.key(); });
    const bool known = at != view.edges.end() && at->key() == edge.key();
    // The graph need not keep an edge for each of its loops.
    (known ? *at : *view.edges.insert(at, edge)).loop = loop.joins_parts ? kJoinsParts : kClosesLoop;
  }
}

std::uint8_t deviation_code(double deviation) {
  if (!(deviation > 0)) return 0;
  return static_cast<std::uint8_t>(std::clamp(std::lround(8 * std::log2(deviation)) + 128L, 1L, 255L));
}

void PointDeviations::find(const MapSnapshot& map) {
  codes_.clear();
  for (const MapSnapshot::Point& point : map.points()) {
    codes_.resize(point.id + 1, 0);  // ids ascend
    codes_.back() = code_of(point.covariance);
  }
}

void PointDeviations::put_into(std::vector<ViewPoint>& points) const {
  for (ViewPoint& point : points)
    if (point.id < codes_.size()) point.deviation = codes_[point.id];
}

std::vector<ViewKeyframe> keyframes_of(const MapSnapshot& map, std::int64_t start_ns) {
  std::vector<ViewKeyframe> keyframes;
  for (const auto& keyframe : map.keyframes()) keyframes.push_back(view_of(keyframe, start_ns));
  return keyframes;
}

ViewMap view_of(const MapSnapshot& map, std::int64_t start_ns, bool with_covariance) {
  ViewMap view;
  view.version = map.version();
  view.keyframes = keyframes_of(map, start_ns);
  for (const auto& point : map.points(with_covariance)) view.points.push_back(view_of(point));
  for (const auto& edge : map.edges()) view.edges.push_back(view_of(edge));
  mark_loops(map.loops(), view);
  return view;
}

}  // namespace twofold
