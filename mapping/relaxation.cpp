#include "mapping/relaxation.hpp"

#include "estimation/pose_graph.hpp"
#include "mapping/double_window.hpp"
#include "mapping/window_builder.hpp"

namespace twofold {

SolverSummary relax_graph(GraphWriter& writer, const Rig& rig, const MapperOptions& options) {
  if (writer.graph().keyframe_count() < 2) return {};
  MapperOptions all = options;
  all.global_outer_window = true;
  DoubleWindow window;
  window.select(writer.graph(), all);

  PoseGraph<SE3> poses;
  poses.origin = 0;  // the search starts at the reference
  for (std::size_t n = 0; n < window.members().size(); ++n) {
    poses.poses.push_back(window.start_pose(n));
    const Keyframe& keyframe = writer.graph().keyframe(window.members()[n].id);
    for (const Edge& edge : *keyframe.edges) {
      if (edge.other < keyframe.id) continue;  // met from the other end
      poses.constraints.push_back(
          {static_cast<int>(n), window.position(edge.other), relative_pose(writer.graph(), keyframe.id, edge),
           edge_information(rig, edge, keyframe.median_depth, options.constraint_share)});
    }
  }
  PoseGraphSolver<SE3> solver;
  const SolverSummary summary = solver.solve(poses, {});
  for (std::size_t n = 0; n < window.members().size(); ++n)
    writer.set_pose(window.members()[n].id, poses.poses[n]);
  return summary;
}

}  // namespace twofold
