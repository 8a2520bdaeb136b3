#include "loopclosure/loop_probation.hpp"

#include <algorithm>
#include <cmath>

#include "base/angles.hpp"

namespace twofold {

std::optional<SE3> pose_in_map(const GraphSnapshot& graph, KeyframeId to, KeyframeId from) {
  const KeyframeId part = graph.part(to);
  if (part == kNoKeyframe || graph.part(from) != part) return std::nullopt;
  return graph.T_k_w(to) * graph.T_k_w(from).inverse();
}

bool LoopProbation::confirms(const LoopConstraint& loop, const GraphSnapshot& graph) {
  end_patience(loop.to);
  const auto as_mapped = pose_in_map(graph, loop.to, loop.from);
  const double depth = loop.scale * graph.keyframe(loop.from).median_depth;
  const bool mapped = as_mapped && same_pose(Sim3(*as_mapped), loop.S_to_from(), depth);
  const bool explained = mapped || !as_mapped || drift_.explains(graph, loop.from, loop.to, loop.S_to_from());
  const bool witnessed = std::any_of(held_.begin(), held_.end(), [&](const Held& held) {
    return held.witness && agree(held.loop, loop, graph);
  });
  const bool confirmed =
      mapped || (explained && witnessed && std::none_of(held_.begin(), held_.end(), [&](const Held& held) {
                   return exclude_each_other(held.loop, loop, graph);
                 }));
  held_.push_back({loop, explained});
  return confirmed;
}

void LoopProbation::hold(const LoopConstraint& loop) {
  end_patience(loop.to);
  held_.push_back({loop, false});
}

void LoopProbation::end_patience(KeyframeId now) {
  std::erase_if(held_, [&](const Held& held) {
    return index(held.loop.to) + static_cast<std::uint32_t>(options_.patience) < index(now);
  });
}

bool LoopProbation::agree(const LoopConstraint& held, const LoopConstraint& loop,
                          const GraphSnapshot& graph) const {
  const auto T_to_to = pose_in_map(graph, loop.to, held.to);
  const auto T_from_from = pose_in_map(graph, held.from, loop.from);
  if (held.to == loop.to || !T_to_to || !T_from_from) return false;
  return same_pose(Sim3(*T_to_to) * held.S_to_from() * Sim3(*T_from_from), loop.S_to_from(),
                   loop.scale * graph.keyframe(loop.from).median_depth);
}

bool LoopProbation::same_pose(const Sim3& S_a, const Sim3& S_b, double depth) const {
  const Sim3 difference = S_a * S_b.inverse();
  return difference.translation().norm() <= options_.max_shift * depth &&
         difference.so3().log().norm() <= options_.max_angle_deg * kDegree &&
         std::abs(std::log(difference.scale())) <= options_.max_scale;
}

/// Each says where this camera is, and so where its own place is as seen from the other's.
bool LoopProbation::exclude_each_other(const LoopConstraint& held, const LoopConstraint& loop,
                                       const GraphSnapshot& graph) const {
  const auto T_to_to = pose_in_map(graph, loop.to, held.to);
  if (!T_to_to) return false;
  return contradicts(loop.from, held.from, loop.S_to_from().inverse() * Sim3(*T_to_to) * held.S_to_from(),
                     graph);
}

bool LoopProbation::contradicts(KeyframeId b, KeyframeId a, const Sim3& S_b_a,
                                const GraphSnapshot& graph) const {
  const auto as_mapped = pose_in_map(graph, b, a);
  return as_mapped && !same_pose(Sim3(*as_mapped), S_b_a, graph.keyframe(b).median_depth) &&
         !drift_.explains(graph, a, b, S_b_a);
}

}  // namespace twofold
