#include "mapping/pose_graph_optimisation.hpp"

#include "mapping/edges.hpp"
#include "mapping/keyframe_pose_graph.hpp"

namespace twofold {
namespace {

PoseGraphUpdate optimise_tree(const GraphSnapshot& graph, const std::vector<TreeNode>& tree, const Rig& rig,
                              const MapperOptions& options, PoseGraphReport& report) {
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

}  // namespace

PoseGraphUpdate optimise_component(const GraphSnapshot& graph, KeyframeId root, const Rig& rig,
                                   const MapperOptions& options, PoseGraphReport& report) {
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(graph, root, graph.keyframe_count(), visited, tree);
  return optimise_tree(graph, tree, rig, options, report);
}

PoseGraphReport optimise_all_components(GraphWriter& writer, const Rig& rig, const MapperOptions& options) {
  PoseGraphReport report;
  for_each_component(writer.graph(), [&](const std::vector<TreeNode>& tree) {
    for (const KeyframePose& pose : optimise_tree(writer.graph(), tree, rig, options, report).poses)
      writer.set_pose(pose.id, pose.T_k_w);
  });
  return report;
}

}  // namespace twofold
