#pragma once

#include <functional>

#include "posegraph/pose_graph.hpp"

namespace twofold::bench {

struct CeresOptions {
  int max_iterations = 300;
  double function_tolerance = 1e-6;
  std::function<void(double cost)> on_cost;  ///< chi2 after the start and every successful iteration
};

struct CeresSummary {
  double initial_cost = 0;  ///< chi2 (twice what Ceres calls cost), error PoseGraphError::kComponents
  double final_cost = 0;
  int iterations = 0;
};

/// Minimises pose_graph_cost(graph, kComponents) with Ceres: Levenberg-Marquardt, sparse Cholesky
/// (SuiteSparse), one thread, automatic derivatives, the graph's origin fixed. Poses are kept as
/// camera in world, the form Ceres' own pose graph examples use.
CeresSummary solve_with_ceres(PoseGraph<SE2>& graph, const CeresOptions& options);
CeresSummary solve_with_ceres(PoseGraph<SE3>& graph, const CeresOptions& options);

}  // namespace twofold::bench
