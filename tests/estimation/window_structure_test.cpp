#include <gtest/gtest.h>

#include "estimation/window_solver.hpp"
#include "fixtures/synthetic_window.hpp"

namespace twofold {
namespace {

double point_cost(const WindowProblem& problem, const WindowProblem::Point& point, double huber) {
  double sum = 0;
  for (int n = 0; n < point.observation_count; ++n) {
    sum += HuberKernel{huber}.rho(observation_chi2(problem, position_w(problem, point),
                                                   problem.observations[point.first_observation + n]));
  }
  return sum;
}

WindowSolverOptions to_convergence() {
  WindowSolverOptions options;
  options.max_iterations = 50;
  options.relative_decrease = 1e-14;
  return options;
}

TEST(OptimiseStructure, FindsTruthAndLeavesPosesAlone) {
  SyntheticWindowOptions options;
  options.start_depth_noise = 0.2;
  options.missing_right = 0.5;
  auto [truth, start] = make_synthetic_window(options);
  const WindowProblem before = start;
  optimise_structure(start, to_convergence());
  for (std::size_t k = 0; k < truth.points.size(); ++k) {
    EXPECT_LT((start.points[k].psi - truth.points[k].psi).norm(), 1e-5) << "point " << k;
  }
  for (std::size_t i = 0; i < truth.poses.size(); ++i) {
    EXPECT_EQ(before.poses[i].T_k_w.matrix(), start.poses[i].T_k_w.matrix());
  }
}

/// With all poses held the window solver minimises the same cost, by other code.
TEST(OptimiseStructure, EqualsTheWindowSolverWithHeldPoses) {
  SyntheticWindowOptions options;
  options.start_depth_noise = 0.1;
  options.start_pose_noise = 0.01;
  options.pixel_noise = 1;
  options.outliers = 0.05;
  auto window = make_synthetic_window(options);
  WindowProblem alone = window.start, together = window.start;
  for (auto& pose : together.poses) pose.fixed = true;
  optimise_structure(alone, to_convergence());
  WindowSolver solver;
  auto solver_options = to_convergence();
  solver_options.max_iterations = 200;
  solver.solve(together, solver_options);
  const double expected = window_cost(together, solver_options);
  EXPECT_NEAR(window_cost(alone, solver_options), expected, 1e-5 * expected);
}

TEST(OptimiseStructure, NoPointGetsWorse) {
  for (unsigned seed = 1; seed < 6; ++seed) {
    SyntheticWindowOptions options;
    options.seed = seed;
    options.start_depth_noise = 0.6;
    options.start_pose_noise = 0.1;
    options.outliers = 0.2;
    options.pixel_noise = 1;
    auto window = make_synthetic_window(options);
    const WindowProblem before = window.start;
    WindowSolverOptions few;
    optimise_structure(window.start, few);
    for (std::size_t k = 0; k < before.points.size(); ++k) {
      const double cost_before = point_cost(before, before.points[k], few.huber_sigmas);
      if (!std::isfinite(cost_before)) continue;
      EXPECT_LE(point_cost(window.start, window.start.points[k], few.huber_sigmas),
                cost_before * (1 + 1e-12));
    }
  }
}

TEST(OptimiseStructure, PointsWithoutUsableObservationsStay) {
  SyntheticWindowOptions options;
  auto window = make_synthetic_window(options);
  WindowProblem& problem = window.truth;
  problem.points[0].observation_count = 0;
  problem.points[1].psi.z() = -0.1;  // behind its anchor
  const Vector3 psi_0 = problem.points[0].psi += Vector3(0.01, 0, 0), psi_1 = problem.points[1].psi;
  optimise_structure(problem, to_convergence());
  EXPECT_EQ(problem.points[0].psi, psi_0);
  EXPECT_EQ(problem.points[1].psi, psi_1);
}

}  // namespace
}  // namespace twofold
