#pragma once

#include <vector>

#include "graph/id_map.hpp"
#include "graph/neighbourhood.hpp"
#include "graph/snapshot.hpp"
#include "posegraph/pose_graph.hpp"

namespace twofold {

/// The keyframes of a spanning tree as a pose graph over `Group`, SE3 or Sim3. Pose n is T_k_w of tree[n],
/// set along the tree from tree[0], which is fixed  (eq. 6.3); each edge between two of them is a constraint,
/// the pose of the one later in the tree relative to the other.
///
/// @param information    of (keyframe, keyframe, edge between them): that of the constraint
/// @param index_in_tree  is filled with that of each keyframe
template <class Group, class Information>
[[nodiscard]] PoseGraph<Group> keyframe_pose_graph(const GraphSnapshot& graph,
                                                   const std::vector<TreeNode>& tree,
                                                   const Information& information, IdMap& index_in_tree) {
  PoseGraph<Group> problem;
  problem.origin = 0;
  for (std::size_t n = 0; n < tree.size(); ++n) {
    index_in_tree.set(tree[n].id, static_cast<int>(n));
    if (n == 0) {
      problem.poses.emplace_back(graph.keyframe(tree[n].id).T_k_w);
      continue;
    }
    const auto parent = static_cast<std::size_t>(tree[n].parent);
    const Edge& edge = *find_edge(graph.keyframe(tree[parent].id), tree[n].id);
    problem.poses.push_back(Group(relative_pose(graph, tree[parent].id, edge)) * problem.poses[parent]);
  }
  for (std::size_t n = 0; n < tree.size(); ++n) {
    const Keyframe& from = graph.keyframe(tree[n].id);
    for (const Edge& edge : *from.edges) {
      const int other = index_in_tree.find(edge.other);
      if (other <= static_cast<int>(n)) continue;  // each edge once
      problem.constraints.push_back({static_cast<int>(n), other, Group(relative_pose(graph, from.id, edge)),
                                     information(from, graph.keyframe(edge.other), edge)});
    }
  }
  return problem;
}

}  // namespace twofold
