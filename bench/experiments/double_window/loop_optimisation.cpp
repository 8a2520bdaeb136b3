#include "experiments/double_window/loop_optimisation.hpp"

#include "posegraph/pose_graph.hpp"

namespace twofold::bench {
namespace {

template <class Group>
std::vector<Group> relax(const GraphSnapshot& graph, const DoubleWindow& window,
                         const SimilarityConstraint& loop, const Group& T_to_from) {
  PoseGraph<Group> poses;
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    const KeyframeId id = window.nodes[n].id;
    poses.poses.emplace_back(graph.T_k_w(id));
    for (const Edge& edge : *graph.keyframe(id).edges) {
      const int other = window.position.find(edge.other);
      if (other <= static_cast<int>(n)) continue;  // outside, or met from the other end
      poses.constraints.push_back({static_cast<int>(n), other, Group(relative_pose(graph, id, edge))});
    }
  }
  poses.origin = window.position.find(loop.from);
  poses.constraints.push_back({poses.origin, window.position.find(loop.to), T_to_from});
  PoseGraphSolver<Group>().solve(poses, {});
  return std::move(poses.poses);
}

}  // namespace

std::vector<Sim3> optimise_loop(const GraphSnapshot& graph, const DoubleWindow& window,
                                const SimilarityConstraint& loop, LoopGroup group) {
  if (group == LoopGroup::kSim3) return relax<Sim3>(graph, window, loop, loop.S_to_from);
  std::vector<Sim3> result;
  for (const SE3& T_k_w : relax<SE3>(graph, window, loop, loop.S_to_from.without_scale())) {
    result.emplace_back(T_k_w);
  }
  return result;
}

}  // namespace twofold::bench
