#include "mapping/keyframe_insertion.hpp"

#include <algorithm>

namespace twofold {
namespace {

void add_confirmed_points(GraphWriter& writer, const KeyframeProposal& proposal) {
  for (const NewPoint& added : proposal.new_points) {
    const GraphSnapshot& graph = writer.graph();
    MapPoint point;
    if (graph.contains(added.anchor) && !graph.keyframe(added.anchor).culled()) {
      point.anchor = added.anchor;
      point.psi = added.psi;
      point.appearance = std::make_shared<const PointAppearance>(added.appearance);
    }
    // A point whose anchor is gone keeps its number, as a culled one.
    writer.add_point(added.id, point);
    if (point.alive()) writer.add_observations(added.anchor, std::span(&added.anchor_observation, 1));
  }
}

}  // namespace

std::vector<std::pair<KeyframeId, int>> covisible_keyframes(const GraphSnapshot& graph, KeyframeId id) {
  std::vector<KeyframeId> seen_by;
  for (const Observation& observation : *graph.keyframe(id).observations) {
    const ObserverList& observers = *graph.point(observation.point).observers;
    seen_by.insert(seen_by.end(), observers.begin(), observers.end());
  }
  std::sort(seen_by.begin(), seen_by.end());
  std::vector<std::pair<KeyframeId, int>> counts;
  for (const KeyframeId other : seen_by) {
    if (other == id) continue;
    if (counts.empty() || counts.back().first != other) counts.emplace_back(other, 0);
    ++counts.back().second;
  }
  return counts;
}

Edge make_edge(const GraphSnapshot& graph, KeyframeId id, KeyframeId other, int weight) {
  Edge edge;
  edge.other = other;
  edge.weight = weight;
  edge.T_other_this = graph.T_k_w(other) * graph.T_k_w(id).inverse();
  const double depth = graph.keyframe(id).median_depth;
  edge.parallax = depth > 0 ? edge.T_other_this.translation().norm() / depth : 0;
  return edge;
}

void insert_keyframe(GraphWriter& writer, const KeyframeProposal& proposal, int theta) {
  const bool first = proposal.reference == kNoKeyframe;
  Keyframe keyframe;
  keyframe.id = proposal.id;
  keyframe.frame_index = proposal.frame_index;
  keyframe.t_ns = proposal.t_ns;
  keyframe.median_depth = proposal.median_depth;
  keyframe.T_k_w = first ? proposal.T_k_ref : proposal.T_k_ref * writer.graph().T_k_w(proposal.reference);
  writer.add_keyframe(std::move(keyframe));
  add_confirmed_points(writer, proposal);

  ObservationList known;
  for (const Observation& observation : proposal.observations) {
    if (writer.graph().contains(observation.point) && writer.graph().point(observation.point).alive()) {
      known.push_back(observation);
    }
  }
  writer.add_observations(proposal.id, known);

  const auto shared = covisible_keyframes(writer.graph(), proposal.id);
  bool joined = false;
  for (const auto& [other, count] : shared) {
    if (count < theta) continue;
    writer.set_edge(proposal.id, make_edge(writer.graph(), proposal.id, other, count));
    joined = true;
  }
  if (!joined && !first) {
    // The graph must not fall apart: the tracker did place this keyframe relative to its reference.
    KeyframeId other = proposal.reference;
    while (writer.graph().keyframe(other).culled()) other = writer.graph().keyframe(other).heir;
    const auto it =
        std::find_if(shared.begin(), shared.end(), [&](const auto& s) { return s.first == other; });
    const int count = it != shared.end() ? it->second : 1;
    writer.set_edge(proposal.id, make_edge(writer.graph(), proposal.id, other, count));
  }
  writer.set_reference(proposal.id);
}

}  // namespace twofold
