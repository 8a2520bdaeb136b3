#include "tests/graph/graph_invariants.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {
namespace {

std::string name(KeyframeId id) {
  return "keyframe " + std::to_string(index(id));
}
std::string name(PointId id) {
  return "point " + std::to_string(index(id));
}

std::string broken_observation(const GraphSnapshot& graph, const Keyframe& keyframe) {
  const auto& list = *keyframe.observations;
  for (std::size_t n = 0; n < list.size(); ++n) {
    const PointId id = list[n].point;
    if (n > 0 && !(list[n - 1].point < id)) return name(keyframe.id) + ": observations not ascending";
    if (!graph.contains(id) || !graph.point(id).alive()) {
      return name(keyframe.id) + " observes culled " + name(id);
    }
    const auto& observers = *graph.point(id).observers;
    if (!std::binary_search(observers.begin(), observers.end(), keyframe.id)) {
      return name(keyframe.id) + " is no observer of " + name(id);
    }
  }
  return {};
}

std::string broken_edge(const GraphSnapshot& graph, const Keyframe& keyframe) {
  const auto& list = *keyframe.edges;
  for (std::size_t n = 0; n < list.size(); ++n) {
    const Edge& edge = list[n];
    const std::string what = name(keyframe.id) + " -> " + name(edge.other);
    if (n > 0 && !(list[n - 1].other < edge.other)) return what + ": edges not ascending";
    if (edge.other == keyframe.id || graph.keyframe(edge.other).culled()) return what + ": no such end";
    const Edge* back = find_edge(graph.keyframe(edge.other), keyframe.id);
    if (!back) return what + ": not symmetric";
    if (back->weight != edge.weight || back->marginalised != edge.marginalised ||
        back->parallax != edge.parallax) {
      return what + ": directions differ";
    }
    if (edge.marginalised && (back->T_other_this * edge.T_other_this).log().norm() > 1e-9) {
      return what + ": relative poses are not inverse";
    }
  }
  return {};
}

bool forgotten(const GraphSnapshot& graph, KeyframeId id) {
  return graph.keyframe(id).culled() && graph.heir(id).id == kNoKeyframe;
}

/// The chain of heirs of one that is known must end in a keyframe that was not culled.
std::string broken_heirs(const GraphSnapshot& graph, KeyframeId id) {
  std::size_t steps = 0;
  if (forgotten(graph, id)) return {};
  for (KeyframeId heir = id; graph.keyframe(heir).culled(); heir = graph.heir(heir).id) {
    if (!graph.contains(graph.heir(heir).id)) return name(heir) + " was culled and has no heir";
    if (++steps > graph.keyframe_count()) return name(id) + ": heirs go in circles";
  }
  return {};
}

std::string broken_keyframe(const GraphSnapshot& graph, KeyframeId id) {
  const Keyframe& keyframe = graph.keyframe(id);
  if (!keyframe.observations || !keyframe.edges) return name(id) + " has no lists";
  if (!forgotten(graph, id) && !graph.T_k_w(id).log().allFinite()) return name(id) + ": pose is not finite";
  if (keyframe.culled()) {
    if (keyframe.observations->empty() && keyframe.edges->empty()) return {};
    return "culled " + name(id) + " still has observations or edges";
  }
  if (keyframe.id != id) return name(id) + " has another's id";
  std::string broken = broken_observation(graph, keyframe);
  return broken.empty() ? broken_edge(graph, keyframe) : broken;
}

std::string broken_point(const GraphSnapshot& graph, PointId id, std::size_t min_observers) {
  const MapPoint& point = graph.point(id);
  if (!point.alive()) return {};
  if (!(point.psi.z() > 0) || !point.psi.allFinite()) return name(id) + ": inverse depth not positive";
  if (point.observers->size() < min_observers) return name(id) + " has too few observers";
  if (forgotten(graph, point.anchor)) return name(id) + ": its anchor is forgotten";
  for (const KeyframeId observer : *point.observers) {
    if (!find_observation(graph.keyframe(observer), id)) {
      return name(id) + ": observer " + name(observer) + " does not observe it";
    }
  }
  const Keyframe& anchor = graph.keyframe(point.anchor);
  if (min_observers > 0 && !anchor.culled() && !find_observation(anchor, id)) {
    return name(id) + ": its anchor does not observe it";
  }
  return {};
}

std::string broken_count(const GraphSnapshot& graph) {
  std::vector<std::uint32_t> anchored(graph.keyframe_count(), 0);
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    const MapPoint& point = graph.point(PointId{p});
    if (point.alive()) ++anchored[index(point.anchor)];
  }
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    const std::uint32_t counted = keyframe.culled() ? graph.heir(KeyframeId{k}).anchored : keyframe.anchored;
    if (counted != anchored[k]) return name(KeyframeId{k}) + ": anchored points miscounted";
  }
  return {};
}

}  // namespace

std::string broken_invariant(const GraphSnapshot& graph, std::size_t min_observers) {
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    if (std::string broken = broken_heirs(graph, KeyframeId{k}); !broken.empty()) return broken;
    if (std::string broken = broken_keyframe(graph, KeyframeId{k}); !broken.empty()) return broken;
  }
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    if (std::string broken = broken_point(graph, PointId{p}, min_observers); !broken.empty()) return broken;
  }
  if (graph.reference() != kNoKeyframe && graph.keyframe(graph.reference()).culled()) {
    return "the reference keyframe is culled";
  }
  return broken_count(graph);
}

std::size_t known_heirs(const GraphSnapshot& graph) {
  std::size_t known = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    known += graph.keyframe(KeyframeId{k}).culled() && !forgotten(graph, KeyframeId{k}) ? 1 : 0;
  }
  return known;
}

std::size_t culled_anchors(const GraphSnapshot& graph) {
  std::size_t anchors = 0;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    anchors += graph.keyframe(KeyframeId{k}).culled() && graph.heir(KeyframeId{k}).anchored > 0 ? 1 : 0;
  }
  return anchors;
}

int component_count(const GraphSnapshot& graph) {
  std::vector<bool> met(graph.keyframe_count(), false);
  int components = 0;
  std::vector<KeyframeId> open;
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    if (met[k] || graph.keyframe(KeyframeId{k}).culled()) continue;
    ++components;
    open.assign(1, KeyframeId{k});
    met[k] = true;
    while (!open.empty()) {
      const KeyframeId id = open.back();
      open.pop_back();
      for (const Edge& edge : *graph.keyframe(id).edges) {
        if (met[index(edge.other)]) continue;
        met[index(edge.other)] = true;
        open.push_back(edge.other);
      }
    }
  }
  return components;
}

}  // namespace twofold
