#include "loopclosure/loop_probation.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace twofold {
namespace {

/// p_to = S_to_from * p_from along the map's poses; none if they are of different parts, or forgotten.
std::optional<Sim3> pose_in_map(const GraphSnapshot& graph, KeyframeId to, KeyframeId from) {
  const KeyframeId part = graph.part(to);
  if (part == kNoKeyframe || graph.part(from) != part) return std::nullopt;
  return Sim3(graph.T_k_w(to) * graph.T_k_w(from).inverse());
}

/// Length of the way between two keyframes of one part, from one keyframe to the next, each step in units of
/// the depth of the scene there. Cost grows with the keyframes between.
double distance_in_depths(const GraphSnapshot& graph, KeyframeId from, KeyframeId to) {
  const auto [first, last] = std::minmax({index(from), index(to)});
  const KeyframeId part = graph.part(to);
  double distance = 0;
  const Keyframe* before = nullptr;
  for (std::uint32_t k = first; k <= last; ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled() || keyframe.part != part) continue;
    if (before != nullptr && keyframe.median_depth > 0)
      distance += (keyframe.T_k_w * before->T_k_w.inverse()).translation().norm() / keyframe.median_depth;
    before = &keyframe;
  }
  return distance;
}

}  // namespace

bool LoopProbation::confirms(const LoopConstraint& loop, const GraphSnapshot& graph) {
  std::erase_if(held_, [&](const LoopConstraint& held) {
    return index(held.to) + static_cast<std::uint32_t>(options_.patience) < index(loop.to);
  });
  const auto as_mapped = pose_in_map(graph, loop.to, loop.from);
  if (scale_drifts_ && as_mapped && !explained_by_drift(*as_mapped, loop, graph)) return false;
  const double depth = loop.scale * graph.keyframe(loop.from).median_depth;
  const bool confirmed =
      (as_mapped && same_pose(*as_mapped, loop.S_to_from(), depth)) ||
      std::any_of(held_.begin(), held_.end(), [&](const auto& held) { return agree(held, loop, graph); });
  held_.push_back(loop);
  return confirmed;
}

bool LoopProbation::agree(const LoopConstraint& held, const LoopConstraint& loop,
                          const GraphSnapshot& graph) const {
  const auto T_to_to = pose_in_map(graph, loop.to, held.to);
  const auto T_from_from = pose_in_map(graph, held.from, loop.from);
  if (held.to == loop.to || !T_to_to || !T_from_from) return false;
  return same_pose(*T_to_to * held.S_to_from() * *T_from_from, loop.S_to_from(),
                   loop.scale * graph.keyframe(loop.from).median_depth);
}

bool LoopProbation::same_pose(const Sim3& S_a, const Sim3& S_b, double depth) const {
  const Sim3 difference = S_a * S_b.inverse();
  return difference.translation().norm() <= options_.max_shift * depth &&
         difference.so3().log().norm() <= options_.max_angle_deg * std::numbers::pi / 180 &&
         std::abs(std::log(difference.scale())) <= options_.max_scale;
}

bool LoopProbation::explained_by_drift(const Sim3& as_mapped, const LoopConstraint& loop,
                                       const GraphSnapshot& graph) const {
  const double distance = distance_in_depths(graph, loop.from, loop.to);
  const Keyframe& to = graph.keyframe(loop.to);
  const Vector3 shift = as_mapped.without_scale().inverse().translation() -
                        loop.S_to_from().without_scale().inverse().translation();
  return shift.norm() <= (options_.max_shift + options_.max_drift * distance) * to.median_depth &&
         std::abs(std::log(loop.scale)) <= options_.max_scale + options_.max_scale_drift * distance;
}

}  // namespace twofold
