#pragma once

#include "estimation/window_problem.hpp"
#include "graph/graph_writer.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Pose-graph relaxation of the whole map over its relative edges (thesis 5.3.2 with the weights of eq. 6.2),
/// started from the spanning tree of the reference keyframe. The reference keyframe stays where it is.
/// Keyframes that no path of edges joins to it are not touched. O(keyframes).
SolverSummary relax_graph(GraphWriter& writer, const Rig& rig, const MapperOptions& options);

}  // namespace twofold
