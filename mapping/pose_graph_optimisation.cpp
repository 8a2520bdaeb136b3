#include "mapping/pose_graph_optimisation.hpp"

#include "graph/id_map.hpp"
#include "graph/neighbourhood.hpp"
#include "mapping/edges.hpp"
#include "posegraph/pose_graph.hpp"

namespace twofold {
namespace {

/// Pose graph of one part: pose n is tree[n], set along the tree from the root  (eq. 6.3).
PoseGraph<SE3> pose_graph(const GraphSnapshot& graph, const std::vector<TreeNode>& tree, const Rig& rig,
                          const MapperOptions& options) {
  PoseGraph<SE3> problem;
  problem.origin = 0;
  IdMap position;
  for (std::size_t n = 0; n < tree.size(); ++n) {
    position.set(tree[n].id, static_cast<int>(n));
    const Keyframe& keyframe = graph.keyframe(tree[n].id);
    if (n == 0) {
      problem.poses.push_back(keyframe.T_k_w);
      continue;
    }
    const auto parent = static_cast<std::size_t>(tree[n].parent);
    const Edge& edge = *find_edge(graph.keyframe(tree[parent].id), tree[n].id);
    problem.poses.push_back(relative_pose(graph, tree[parent].id, edge) * problem.poses[parent]);
  }
  for (std::size_t n = 0; n < tree.size(); ++n) {
    const Keyframe& from = graph.keyframe(tree[n].id);
    for (const Edge& edge : *from.edges) {
      const int other = position.find(edge.other);
      if (other <= static_cast<int>(n)) continue;
      problem.constraints.push_back(
          {static_cast<int>(n), other, relative_pose(graph, from.id, edge),
           edge_information(from, graph.keyframe(edge.other), edge, rig, options.edge)});
    }
  }
  return problem;
}

}  // namespace

PoseGraphUpdate optimise_part(const GraphSnapshot& graph, KeyframeId root, const Rig& rig,
                              const MapperOptions& options, PoseGraphReport& report) {
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(graph, root, graph.keyframe_count(), visited, tree);
  PoseGraph<SE3> problem = pose_graph(graph, tree, rig, options);
  PoseGraphSolver<SE3> solver;
  const SolverSummary summary = solver.solve(problem, {});
  PoseGraphUpdate update;
  update.snapshot_version = graph.version();
  update.poses.reserve(tree.size());
  for (std::size_t n = 0; n < tree.size(); ++n) update.poses.push_back({tree[n].id, problem.poses[n]});
  ++report.parts;
  report.keyframes += static_cast<int>(tree.size());
  report.constraints += static_cast<int>(problem.constraints.size());
  report.initial_cost += summary.initial_cost;
  report.final_cost += summary.final_cost;
  return update;
}

PoseGraphReport optimise_all_parts(GraphWriter& writer, const Rig& rig, const MapperOptions& options) {
  PoseGraphReport report;
  const GraphSnapshot& graph = writer.graph();
  std::vector<KeyframeId> roots{graph.reference()};
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) roots.push_back(KeyframeId{k});
  IdMap done;
  for (const KeyframeId root : roots) {
    if (!graph.contains(root) || done.contains(root) || graph.keyframe(root).culled()) continue;
    for (const KeyframePose& pose : optimise_part(graph, root, rig, options, report).poses) {
      writer.set_pose(pose.id, pose.T_k_w);
      done.set(pose.id, 0);
    }
  }
  return report;
}

}  // namespace twofold
