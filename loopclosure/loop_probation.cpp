#include "loopclosure/loop_probation.hpp"

#include <algorithm>
#include <numbers>

namespace twofold {
namespace {

/// p_to = T_to_from * p_from along the map's poses; none if they are of different parts, or forgotten.
std::optional<SE3> pose_in_map(const GraphSnapshot& graph, KeyframeId to, KeyframeId from) {
  const KeyframeId part = graph.part(to);
  if (part == kNoKeyframe || graph.part(from) != part) return std::nullopt;
  return graph.T_k_w(to) * graph.T_k_w(from).inverse();
}

}  // namespace

bool LoopProbation::confirms(const LoopConstraint& loop, const GraphSnapshot& graph) {
  std::erase_if(held_, [&](const LoopConstraint& held) {
    return index(held.to) + static_cast<std::uint32_t>(options_.patience) < index(loop.to);
  });
  const auto as_mapped = pose_in_map(graph, loop.to, loop.from);
  const double depth = graph.keyframe(loop.from).median_depth;
  const bool confirmed =
      (as_mapped && same_pose(*as_mapped, loop.T_to_from, depth)) ||
      std::any_of(held_.begin(), held_.end(), [&](const auto& held) { return agree(held, loop, graph); });
  held_.push_back(loop);
  return confirmed;
}

bool LoopProbation::agree(const LoopConstraint& held, const LoopConstraint& loop,
                          const GraphSnapshot& graph) const {
  const auto T_to_to = pose_in_map(graph, loop.to, held.to);
  const auto T_from_from = pose_in_map(graph, held.from, loop.from);
  if (held.to == loop.to || !T_to_to || !T_from_from) return false;
  return same_pose(*T_to_to * held.T_to_from * *T_from_from, loop.T_to_from,
                   graph.keyframe(loop.from).median_depth);
}

bool LoopProbation::same_pose(const SE3& T_a, const SE3& T_b, double depth) const {
  const SE3 difference = T_a * T_b.inverse();
  return difference.translation().norm() <= options_.max_shift * depth &&
         difference.so3().log().norm() <= options_.max_angle_deg * std::numbers::pi / 180;
}

}  // namespace twofold
