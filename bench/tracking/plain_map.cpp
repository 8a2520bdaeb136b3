#include "plain_map.hpp"

#include <algorithm>

namespace twofold {

void PlainMap::insert(const KeyframeProposal& proposal) {
  Keyframe keyframe;
  keyframe.id = proposal.id;
  keyframe.frame_index = proposal.frame_index;
  keyframe.t_ns = proposal.t_ns;
  keyframe.median_depth = proposal.median_depth;
  keyframe.T_k_w = proposal.reference == kNoKeyframe
                       ? proposal.T_k_ref
                       : proposal.T_k_ref * writer_.graph().T_k_w(proposal.reference);
  writer_.add_keyframe(keyframe);
  for (const NewPoint& created : proposal.new_points) {
    MapPoint point;
    point.anchor = created.anchor;
    point.psi = created.psi;
    point.appearance = std::make_shared<const PointAppearance>(created.appearance);
    writer_.add_point(created.id, point);
    writer_.add_observations(created.anchor, std::span(&created.anchor_observation, 1));
  }
  writer_.add_observations(proposal.id, proposal.observations);
  writer_.set_reference(proposal.id);
  // New points also tie their anchors to the keyframes that see them.
  link(writer_.graph().keyframe(proposal.id));
}

void PlainMap::transform(const SE3& T_v_w) {
  for (std::uint32_t k = 0; k < writer_.graph().keyframe_count(); ++k) {
    writer_.set_pose(KeyframeId{k}, writer_.graph().keyframe(KeyframeId{k}).T_k_w * T_v_w.inverse());
  }
}

void PlainMap::link(const Keyframe& keyframe) {
  const GraphSnapshot& graph = writer_.graph();
  shared_.assign(graph.keyframe_count(), 0);
  for (const Observation& observation : *keyframe.observations) {
    for (const KeyframeId id : *graph.point(observation.point).observers) ++shared_[index(id)];
  }
  for (std::uint32_t other = 0; other < shared_.size(); ++other) {
    if (KeyframeId{other} == keyframe.id || shared_[other] < min_shared_) continue;
    Edge edge;
    edge.other = KeyframeId{other};
    edge.weight = shared_[other];
    edge.T_other_this = graph.T_k_w(edge.other) * graph.T_k_w(keyframe.id).inverse();
    writer_.set_edge(keyframe.id, edge);
  }
}

}  // namespace twofold
