#include "graph/graph_writer.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace twofold {
namespace {

bool by_point(const Observation& a, const Observation& b) {
  return a.point < b.point;
}

Edge reversed(KeyframeId id, const Edge& edge) {
  Edge back = edge;
  back.other = id;
  back.T_other_this = edge.T_other_this.inverse();
  return back;
}

}  // namespace

GraphSnapshot GraphWriter::publish() {
  GraphSnapshot sealed = graph_;
  ++graph_.version_;
  return sealed;
}

void GraphWriter::add_keyframe(Keyframe keyframe) {
  TWOFOLD_CHECK(index(keyframe.id) == graph_.keyframe_count(), "keyframe ids are dense");
  if (!keyframe.observations) keyframe.observations = no_observations();
  if (!keyframe.edges) keyframe.edges = no_edges();
  keyframe.anchored = 0;
  graph_.keyframes_.push_back(std::move(keyframe));
}

void GraphWriter::add_culled_keyframe(const Replacement& replacement) {
  const KeyframeId id{static_cast<std::uint32_t>(graph_.keyframe_count())};
  TWOFOLD_CHECK(replacement.id != id, "a culled keyframe is not its own replacement");
  graph_.keyframes_.extend(graph_.keyframe_count() + 1);
  graph_.replacements_.extend(graph_.keyframe_count());
  if (replacement.id != kNoKeyframe) put_replacement(id, {replacement.id, 0, replacement.T_this_replacement});
}

void GraphWriter::add_forgotten_keyframes(std::size_t count) {
  graph_.keyframes_.extend(graph_.keyframe_count() + count);
  graph_.replacements_.extend(graph_.keyframe_count());
}

void GraphWriter::put_replacement(KeyframeId id, const Replacement& replacement) {
  graph_.replacements_.extend(std::size_t{index(id)} + 1);
  graph_.replacements_.mutate(index(id)) = replacement;
}

/// Counts points by their anchors, so that a culled one is known for as long as it has any.
std::uint32_t& GraphWriter::anchored(KeyframeId id) {
  if (!graph_.keyframe(id).culled()) return graph_.keyframes_.mutate(index(id)).anchored;
  TWOFOLD_CHECK(graph_.replacement(id).id != kNoKeyframe, "the anchor of a point is known");
  return graph_.replacements_.mutate(index(id)).anchored;
}

void GraphWriter::add_point(PointId id, MapPoint point) {
  TWOFOLD_CHECK(index(id) >= graph_.point_count(), "a point is added once, in order of ids");
  graph_.points_.extend(std::size_t{index(id)} + 1);
  if (point.culled()) return;
  ++anchored(point.anchor);
  if (!point.observers) point.observers = std::make_shared<const ObserverList>();
  graph_.points_.mutate(index(id)) = std::move(point);
}

void GraphWriter::add_observations(KeyframeId id, std::span<const Observation> observations) {
  ObservationList added(observations.begin(), observations.end());
  std::sort(added.begin(), added.end(), by_point);
  Keyframe& keyframe = graph_.keyframes_.mutate(index(id));
  auto merged = std::make_shared<ObservationList>();
  merged->reserve(keyframe.observations->size() + added.size());
  // set_union takes equal elements from its first range: new measurements replace old ones.
  std::set_union(added.begin(), added.end(), keyframe.observations->begin(), keyframe.observations->end(),
                 std::back_inserter(*merged), by_point);
  keyframe.observations = std::move(merged);
  for (const Observation& observation : added) {
    MapPoint& point = graph_.points_.mutate(index(observation.point));
    TWOFOLD_CHECK(!point.culled(), "a culled point cannot be observed");
    const ObserverList& old = *point.observers;
    const auto at = std::lower_bound(old.begin(), old.end(), id);
    if (at != old.end() && *at == id) continue;
    auto observers = std::make_shared<ObserverList>();
    observers->reserve(old.size() + 1);
    observers->assign(old.begin(), at);
    observers->push_back(id);
    observers->insert(observers->end(), at, old.end());
    point.observers = std::move(observers);
  }
}

void GraphWriter::remove_observations(KeyframeId id, std::span<const PointId> points) {
  Keyframe& keyframe = graph_.keyframes_.mutate(index(id));
  auto kept = std::make_shared<ObservationList>();
  kept->reserve(keyframe.observations->size());
  for (const Observation& observation : *keyframe.observations) {
    if (std::binary_search(points.begin(), points.end(), observation.point)) {
      remove_observer(observation.point, id);
    } else {
      kept->push_back(observation);
    }
  }
  keyframe.observations = std::move(kept);
}

void GraphWriter::remove_observer(PointId point_id, KeyframeId keyframe) {
  MapPoint& point = graph_.points_.mutate(index(point_id));
  auto kept = std::make_shared<ObserverList>(*point.observers);
  std::erase(*kept, keyframe);
  point.observers = std::move(kept);
}

void GraphWriter::put_edge(KeyframeId id, const Edge& edge) {
  Keyframe& keyframe = graph_.keyframes_.mutate(index(id));
  auto edges = std::make_shared<EdgeList>(*keyframe.edges);
  const auto at = std::lower_bound(edges->begin(), edges->end(), edge.other,
                                   [](const Edge& e, KeyframeId other) { return e.other < other; });
  if (at != edges->end() && at->other == edge.other) {
    *at = edge;
  } else {
    edges->insert(at, edge);
  }
  keyframe.edges = std::move(edges);
}

void GraphWriter::set_edge(KeyframeId id, const Edge& edge) {
  TWOFOLD_CHECK(edge.other != id, "an edge joins two keyframes");
  TWOFOLD_CHECK(!graph_.keyframe(id).culled() && !graph_.keyframe(edge.other).culled(),
                "culled keyframes have no edges");
  put_edge(id, edge);
  put_edge(edge.other, reversed(id, edge));
}

void GraphWriter::remove_edge(KeyframeId id, KeyframeId other) {
  for (const auto& [from, to] : {std::pair(id, other), std::pair(other, id)}) {
    Keyframe& keyframe = graph_.keyframes_.mutate(index(from));
    auto edges = std::make_shared<EdgeList>(*keyframe.edges);
    std::erase_if(*edges, [&, target = to](const Edge& edge) { return edge.other == target; });
    keyframe.edges = std::move(edges);
  }
}

void GraphWriter::cull_point(PointId id) {
  if (graph_.point(id).culled()) return;
  const ObserverList observers = *graph_.point(id).observers;
  for (const KeyframeId keyframe : observers) remove_observations(keyframe, std::span(&id, 1));
  --anchored(graph_.point(id).anchor);
  graph_.points_.forget(index(id));
}

void GraphWriter::cull_keyframe(KeyframeId id, KeyframeId replacement) {
  TWOFOLD_CHECK(!graph_.keyframe(replacement).culled() && replacement != id,
                "a replacement must stay in the map");
  TWOFOLD_CHECK(!graph_.keyframe(id).culled() && id != graph_.reference(),
                "a keyframe is culled once, and never the reference");
  const SE3 T_this_replacement = graph_.keyframe(id).T_k_w * graph_.keyframe(replacement).T_k_w.inverse();
  std::vector<PointId> points;
  for (const Observation& observation : *graph_.keyframe(id).observations)
    points.push_back(observation.point);
  remove_observations(id, points);
  const EdgeList edges = *graph_.keyframe(id).edges;
  for (const Edge& edge : edges) remove_edge(id, edge.other);
  put_replacement(id, {replacement, graph_.keyframe(id).anchored, PackedPose(T_this_replacement)});
  replacements_.push_back({id, ++culled_});
  graph_.keyframes_.forget(index(id));
}

void GraphWriter::shorten_replacements(KeyframeId id) {
  if (!graph_.keyframe(id).culled()) return;
  const Replacement& replacement = graph_.replacement(id);
  if (replacement.id == kNoKeyframe || !graph_.keyframe(replacement.id).culled()) return;
  const auto live_replacement = graph_.live_replacement(id);
  put_replacement(id,
                  {live_replacement->id, replacement.anchored, PackedPose(live_replacement->T_this_live)});
}

void GraphWriter::scale_replacement(KeyframeId id, double factor) {
  Replacement& replacement = graph_.replacements_.mutate(index(id));
  TWOFOLD_CHECK(replacement.id != kNoKeyframe, "a replacement that is scaled is known");
  const SE3 T = replacement.T_this_replacement.unpacked();
  replacement.T_this_replacement = PackedPose(SE3(T.so3(), factor * T.translation()));
}

/// No replacement that is kept leads to one that is forgotten: whatever hung on a keyframe when that was
/// culled is before it in the queue, and so is looked at, and hung on a keyframe that is not culled,
/// before that one's own turn comes.
void GraphWriter::forget_replacements(std::size_t keep, std::size_t visits) {
  for (std::size_t n = std::min(visits, replacements_.size()); n > 0; --n) {
    const Kept kept = replacements_.front();
    if (culled_ - kept.culled < keep) return;
    replacements_.pop_front();
    shorten_replacements(kept.id);
    if (graph_.replacement(kept.id).anchored > 0) {
      replacements_.push_back(kept);
      continue;
    }
    graph_.replacements_.forget(index(kept.id));
  }
}

/// Of a graph made elsewhere, in any order: first all are hung on keyframes that are not culled.
void GraphWriter::list_replacements() {
  replacements_.clear();
  for (std::uint32_t k = 0; k < graph_.keyframe_count(); ++k) {
    const KeyframeId id{k};
    if (!graph_.keyframe(id).culled() || graph_.replacement(id).id == kNoKeyframe) continue;
    shorten_replacements(id);
    replacements_.push_back({id, ++culled_});
  }
}

}  // namespace twofold
