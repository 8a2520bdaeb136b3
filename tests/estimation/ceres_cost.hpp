#pragma once

#include "fixtures/ceres_window.hpp"

namespace twofold {

/// Cost of the problem where Ceres takes it.
inline double ceres_cost(const WindowProblem& problem, const WindowSolverOptions& options) {
  CeresWindow window(problem, options);
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = ceres::SPARSE_SCHUR;
  ceres_options.max_num_iterations = 300;
  ceres_options.max_trust_region_radius = 1e9;  // its damping fixes the gauge
  ceres_options.function_tolerance = 1e-15;
  ceres_options.gradient_tolerance = 1e-14;
  ceres_options.parameter_tolerance = 1e-14;
  window.solve(ceres_options);
  return window_cost(window.values(), options);
}

}  // namespace twofold
