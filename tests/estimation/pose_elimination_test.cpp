#include "bench/estimation/pose_elimination.hpp"

#include <gtest/gtest.h>

#include "estimation/window_solver.hpp"
#include "tests/estimation/ceres_cost.hpp"
#include "tests/estimation/window_cases.hpp"

namespace twofold {
namespace {

TEST(PoseElimination, IsEqualToCeresAndToTheWindowSolver) {
  for (const bool fixed : {false, true}) {
    for (const double huber : {0.0, 1.0}) {
      auto options = small_window();
      options.inner = 60;
      options.spacing = 0.02;
      options.max_track = 60;
      options.pixel_noise = 0.7;
      options.missing_right = 0.3;
      WindowProblem problem = make_synthetic_window(options).start;
      ASSERT_FALSE(PoseElimination::is_cheaper(problem));
      problem.points.resize(30);
      const auto& last = problem.points.back();
      problem.observations.resize(static_cast<std::size_t>(last.first_observation + last.observation_count));
      ASSERT_TRUE(PoseElimination::is_cheaper(problem));
      if (fixed) problem.poses.front().fixed = problem.poses.back().fixed = true;
      const Matrix4 front = problem.poses.front().T_k_w.matrix();
      auto solver_options = to_convergence();
      solver_options.huber_sigmas = huber;
      const double reference = ceres_cost(problem, solver_options);
      auto again = problem, points_first = problem;
      const SolverSummary summary = PoseElimination().solve(problem, solver_options);
      EXPECT_NEAR(summary.final_cost, reference, 1e-6 * reference);
      // In the problem's own form, points relative to their moved anchors.
      EXPECT_NEAR(window_cost(problem, solver_options), summary.final_cost, 1e-9 * reference);
      EXPECT_LT(summary.final_cost, 0.5 * summary.initial_cost);
      if (fixed) {
        EXPECT_EQ(front, problem.poses.front().T_k_w.matrix());
      }
      EXPECT_EQ(PoseElimination().solve(again, solver_options).final_cost, summary.final_cost);
      EXPECT_NEAR(WindowSolver().solve(points_first, solver_options).final_cost, reference, 1e-6 * reference);
    }
  }
}

}  // namespace
}  // namespace twofold
