#include "mapping/pose_graph_optimisation.hpp"

#include "mapping/edges.hpp"
#include "mapping/keyframe_pose_graph.hpp"

namespace twofold {
PoseGraphUpdate optimise_component(const GraphSnapshot& graph, KeyframeId root, const Rig& rig,
                                   const MapperOptions& options, PoseGraphReport& report) {
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(graph, root, graph.keyframe_count(), visited, tree);
  IdMap position;
  const auto information = [&](const Keyframe& from, const Keyframe& to, const Edge& edge) {
    return edge_information(from, to, edge, rig, options.edge);
  };
  PoseGraph<SE3> problem = keyframe_pose_graph<SE3>(graph, tree, information, position);
  PoseGraphSolver<SE3> solver;
  const SolverSummary summary = solver.solve(problem, {});
  PoseGraphUpdate update;
  update.snapshot_version = graph.version();
  update.poses.reserve(tree.size());
  for (std::size_t n = 0; n < tree.size(); ++n) update.poses.push_back({tree[n].id, problem.poses[n]});
  ++report.components;
  report.keyframes += static_cast<int>(tree.size());
  report.constraints += static_cast<int>(problem.constraints.size());
  report.initial_cost += summary.initial_cost;
  report.final_cost += summary.final_cost;
  return update;
}

PoseGraphReport optimise_all_components(GraphWriter& writer, const Rig& rig, const MapperOptions& options) {
  PoseGraphReport report;
  const GraphSnapshot& graph = writer.graph();
  std::vector<KeyframeId> roots{graph.reference()};
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) roots.push_back(KeyframeId{k});
  IdMap done;
  for (const KeyframeId root : roots) {
    if (!graph.contains(root) || done.contains(root) || graph.keyframe(root).culled()) continue;
    for (const KeyframePose& pose : optimise_component(graph, root, rig, options, report).poses) {
      writer.set_pose(pose.id, pose.T_k_w);
      done.set(pose.id, 0);
    }
  }
  return report;
}

}  // namespace twofold
