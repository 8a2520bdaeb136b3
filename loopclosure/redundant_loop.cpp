#include "loopclosure/redundant_loop.hpp"

#include <algorithm>
#include <cmath>

namespace twofold {

bool RedundantLoops::has(const LoopConstraint& loop, std::span<const MotionObservation> found,
                         const GraphSnapshot& graph) {
  return graph.part(loop.from) == graph.part(loop.to) &&
         std::abs(std::log(loop.scale)) <= options_.max_log_scale && moves_nothing(loop, found, graph) &&
         short_way(loop, graph);
}

/// Where the map has the keyframe, its points fall on the pixels on which they fall by the loop.
bool RedundantLoops::moves_nothing(const LoopConstraint& loop, std::span<const MotionObservation> found,
                                   const GraphSnapshot& graph) const {
  const SE3 T_mapped = graph.T_k_w(loop.to) * graph.T_k_w(loop.from).inverse();
  // Points are in the unit of loop.from, which is the map's.
  const SE3 T_seen(loop.T_to_from.so3(), loop.T_to_from.translation() / loop.scale);
  double squares = 0;
  int count = 0;
  for (const MotionObservation& observation : found) {
    if (!observation.inlier) continue;
    const Vector3 mapped = T_mapped * observation.x_ref, seen = T_seen * observation.x_ref;
    if (!in_front_of_camera(mapped) || !in_front_of_camera(seen)) return false;
    squares += (camera_.project(mapped) - camera_.project(seen)).squaredNorm();
    ++count;
  }
  return count > 0 && squares <= count * options_.max_shift_px * options_.max_shift_px;
}

bool RedundantLoops::short_way(const LoopConstraint& loop, const GraphSnapshot& graph) {
  weighted_breadth_first(graph, loop.to, static_cast<std::size_t>(options_.max_keyframes), visited_, tree_);
  if (!visited_.contains(index(loop.from))) return false;
  ways_.assign(tree_.size(), 0);
  for (std::size_t n = 1; n < tree_.size(); ++n) {
    const auto parent = static_cast<std::size_t>(tree_[n].parent);
    const Keyframe& near = graph.keyframe(tree_[parent].id);
    const Keyframe& far = graph.keyframe(tree_[n].id);
    ways_[n] = ways_[parent] + way_length(near, far, relative_pose(graph, near.id, *find_edge(near, far.id)));
    if (tree_[n].id == loop.from) return ways_[n] <= options_.max_way;
  }
  return false;
}

}  // namespace twofold
