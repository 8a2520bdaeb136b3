#include "graph/part_extraction.hpp"

#include <algorithm>

#include "graph/id_map.hpp"

namespace twofold {
namespace {

/// New numbers of the keyframes and points that are kept.
class Renumbering {
 public:
  Renumbering(const GraphSnapshot& graph, KeyframeId part)
      : keyframes_(graph.keyframe_count(), kNoKeyframe), points_(graph.point_count(), kNoPoint) {
    std::uint32_t keyframes = 0, points = 0;
    for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
      const KeyframeId id{k};
      if (graph.keyframe(id).culled() && graph.replacement(id).anchored == 0) continue;
      if (graph.part(id) == part) keyframes_[k] = KeyframeId{keyframes++};
    }
    for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
      const MapPoint& point = graph.point(PointId{p});
      if (!point.culled() && (*this)(point.anchor) != kNoKeyframe) points_[p] = PointId{points++};
    }
  }
  [[nodiscard]] KeyframeId operator()(KeyframeId id) const { return keyframes_[index(id)]; }
  [[nodiscard]] PointId operator()(PointId id) const { return points_[index(id)]; }

 private:
  std::vector<KeyframeId> keyframes_;
  std::vector<PointId> points_;
};

Keyframe renumbered(const Keyframe& keyframe, const Renumbering& number) {
  Keyframe copy = keyframe;
  copy.id = number(keyframe.id);
  copy.part = KeyframeId{0};
  // Both lists stay in order, because new numbers are in the order of the old ones.
  auto observations = std::make_shared<ObservationList>();
  for (Observation observation : *keyframe.observations) {
    observation.point = number(observation.point);
    if (observation.point != kNoPoint) observations->push_back(observation);
  }
  auto edges = std::make_shared<EdgeList>(*keyframe.edges);
  for (Edge& edge : *edges) edge.other = number(edge.other);
  copy.observations = std::move(observations);
  copy.edges = std::move(edges);
  return copy;
}

MapPoint renumbered(const MapPoint& point, const Renumbering& number) {
  MapPoint copy = point;
  copy.anchor = number(point.anchor);
  auto observers = std::make_shared<ObserverList>(*point.observers);
  for (KeyframeId& observer : *observers) observer = number(observer);
  copy.observers = std::move(observers);
  return copy;
}

}  // namespace

void name_parts(GraphWriter& writer) {
  const GraphSnapshot& graph = writer.graph();
  IdMap name;  // number of the part's first keyframe
  std::vector<KeyframeId> open;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    if (name.contains(KeyframeId{k}) || graph.keyframe(KeyframeId{k}).culled()) continue;
    name.set(k, static_cast<int>(k));
    open.push_back(KeyframeId{k});
    while (!open.empty()) {
      const KeyframeId at = open.back();
      open.pop_back();
      for (const Edge& edge : *graph.keyframe(at).edges) {
        if (name.contains(edge.other)) continue;
        name.set(edge.other, static_cast<int>(k));
        open.push_back(edge.other);
      }
    }
  }
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled()) continue;
    const KeyframeId part{static_cast<std::uint32_t>(name.find(k))};
    if (keyframe.part != part) writer.set_part(KeyframeId{k}, part);
  }
}

std::vector<KeyframeId> parts_of(const GraphSnapshot& graph) {
  std::vector<KeyframeId> parts;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (!keyframe.culled()) parts.push_back(keyframe.part);
  }
  std::sort(parts.begin(), parts.end());
  parts.erase(std::unique(parts.begin(), parts.end()), parts.end());
  return parts;
}

KeyframeId oldest_part(const GraphSnapshot& graph) {
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (!keyframe.culled()) return keyframe.part;
  }
  return kNoKeyframe;
}

SavedMap extract_part(const Rig& rig, const GraphSnapshot& graph, const KeyframeDatabase& places,
                      KeyframeId part) {
  const Renumbering number(graph, part);
  GraphWriter writer;
  SavedMap map;
  map.rig = rig;
  KeyframeId newest = kNoKeyframe;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    const KeyframeId id = number(KeyframeId{k});
    if (id == kNoKeyframe) continue;
    if (keyframe.culled()) {
      const auto [replacement, T_this_replacement] = *graph.live_replacement(KeyframeId{k});
      writer.add_culled_keyframe({number(replacement), 0, PackedPose(T_this_replacement)});
      continue;
    }
    writer.add_keyframe(renumbered(keyframe, number));
    newest = id;
    if (const PlaceAppearance* place = places.find(keyframe.id)) map.places.set(id, *place);
  }
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    if (number(PointId{p}) != kNoPoint)
      writer.add_point(number(PointId{p}), renumbered(graph.point(PointId{p}), number));
  }
  const bool has_reference =
      graph.reference() != kNoKeyframe && graph.keyframe(graph.reference()).part == part;
  writer.set_reference(has_reference ? number(graph.reference()) : newest);
  map.graph = writer.publish();
  return map;
}

}  // namespace twofold
