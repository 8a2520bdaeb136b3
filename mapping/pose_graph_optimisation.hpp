#pragma once

#include "camera/rig.hpp"
#include "graph/graph_writer.hpp"
#include "graph/pose_graph_update.hpp"
#include "mapping/options.hpp"

namespace twofold {

struct PoseGraphReport {
  int components = 0;  ///< of the graph, each optimised on its own
  int keyframes = 0;
  int constraints = 0;
  double initial_cost = 0;
  double final_cost = 0;
};

/// Optimises the poses of all keyframes that are connected with `root` (eq. 6.4 without points, with
/// everything in the outer window); `root` is fixed. Changes nothing: it runs beside the mapper, which takes
/// the result as a message (Mapper::take_pose_graph). Cost grows with the number of keyframes.
PoseGraphUpdate optimise_component(const GraphSnapshot& graph, KeyframeId root, const Rig& rig,
                                   const MapperOptions& options, PoseGraphReport& report);

/// Optimises all keyframe poses, one connected component after the other. Outside of the double window poses
/// are only defined relative to their neighbours; this makes them agree globally, e.g. before a trajectory is
/// written. The reference keyframe, or the oldest one of a component without it, stays where it is. Cost
/// grows with the map.
PoseGraphReport optimise_all_components(GraphWriter& writer, const Rig& rig, const MapperOptions& options);

}  // namespace twofold
