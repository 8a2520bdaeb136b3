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

/// From one keyframe to the next.
struct Way {
  double distance = 0;  ///< each step in units of the depth of the scene there
  double turned = 0;    ///< [rad], without what a head or a car nods: of steps that lead somewhere
};

/// Between two keyframes of one part. Cost grows with the keyframes between.
Way way_between(const GraphSnapshot& graph, KeyframeId from, KeyframeId to) {
  constexpr double kStep = 1, kTurn = 0.3;  // [depths], [rad]
  const auto [first, last] = std::minmax({index(from), index(to)});
  const KeyframeId part = graph.part(to);
  Way way;
  const Keyframe* before = nullptr;
  const Keyframe* corner = nullptr;  // since which turning is counted
  double distance_at_corner = 0;
  for (std::uint32_t k = first; k <= last; ++k) {
    const Keyframe& keyframe = graph.keyframe(KeyframeId{k});
    if (keyframe.culled() || keyframe.part != part) continue;
    if (before != nullptr && keyframe.median_depth > 0)
      way.distance += (keyframe.T_k_w * before->T_k_w.inverse()).translation().norm() / keyframe.median_depth;
    before = &keyframe;
    const double turn =
        corner == nullptr ? 0 : (keyframe.T_k_w.so3() * corner->T_k_w.so3().inverse()).log().norm();
    if (corner != nullptr && turn < kTurn && way.distance - distance_at_corner < kStep) continue;
    way.turned += turn;
    corner = &keyframe;
    distance_at_corner = way.distance;
  }
  return way;
}

}  // namespace

bool LoopProbation::confirms(const LoopConstraint& loop, const GraphSnapshot& graph) {
  std::erase_if(held_, [&](const LoopConstraint& held) {
    return index(held.to) + static_cast<std::uint32_t>(options_.patience) < index(loop.to);
  });
  const auto as_mapped = pose_in_map(graph, loop.to, loop.from);
  if (as_mapped && !explained_by_drift(*as_mapped, loop, graph)) return false;
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
  const Way way = way_between(graph, loop.from, loop.to);
  const double depth = graph.keyframe(loop.to).median_depth;
  const Vector3 shift = as_mapped.without_scale().inverse().translation() -
                        loop.S_to_from().without_scale().inverse().translation();
  const double turn = (as_mapped.so3() * loop.S_to_from().so3().inverse()).log().norm();
  const double scale = std::abs(std::log(loop.scale));
  const double turn_drift = scale_drifts_ ? options_.max_turn_drift_of_one_camera : options_.max_turn_drift;
  const double drift = options_.max_drift + 0.5 * (scale + turn);
  return shift.norm() <= (options_.slack + drift * way.distance) * depth &&
         turn <= options_.slack_deg * std::numbers::pi / 180 + turn_drift * way.turned &&
         (!scale_drifts_ || scale <= options_.max_scale + options_.max_scale_drift * way.distance);
}

}  // namespace twofold
