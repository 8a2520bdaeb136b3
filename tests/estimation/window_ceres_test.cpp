// The window solver against Ceres on the same cost.
#include <gtest/gtest.h>

#include <vector>

#include "estimation/pose_elimination.hpp"
#include "fixtures/ceres_window.hpp"
#include "tests/estimation/window_cases.hpp"

namespace twofold {
namespace {

double ceres_cost(const WindowProblem& problem, const WindowSolverOptions& options) {
  CeresWindow window(problem, options);
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = ceres::SPARSE_SCHUR;
  ceres_options.max_num_iterations = 300;
  ceres_options.max_trust_region_radius = 1e9;  // its damping holds the gauge
  ceres_options.function_tolerance = 1e-15;
  ceres_options.gradient_tolerance = 1e-14;
  ceres_options.parameter_tolerance = 1e-14;
  window.solve(ceres_options);
  return window_cost(window.values(), options);
}

struct CeresCase {
  const char* name;
  SyntheticWindowOptions window;
  double huber, constraint_huber;
  bool fixed_rim;
};

class EqualToCeres : public testing::TestWithParam<CeresCase> {};

TEST_P(EqualToCeres, AtConvergence) {
  auto window = make_synthetic_window(GetParam().window);
  WindowProblem& problem = window.start;
  if (GetParam().fixed_rim) problem.poses.front().fixed = problem.poses.back().fixed = true;
  auto options = to_convergence();
  options.huber_px = GetParam().huber;
  options.constraint_huber = GetParam().constraint_huber;
  const double reference = ceres_cost(problem, options);
  const auto front = problem.poses.front().T_k_w.matrix();

  WindowSolver solver;
  const SolverSummary summary = solver.solve(problem, options);
  EXPECT_NEAR(summary.final_cost, reference, 1e-6 * reference);
  EXPECT_NEAR(window_cost(problem, options), summary.final_cost, 1e-9 * reference);
  EXPECT_LT(summary.final_cost, 0.5 * summary.initial_cost);
  if (GetParam().fixed_rim) {
    EXPECT_EQ(front, problem.poses.front().T_k_w.matrix());
  }
}

std::vector<CeresCase> ceres_cases() {
  auto noisy = small_window();
  noisy.pixel_noise = 0.7;
  noisy.missing_right = 0.3;
  auto rim = noisy;
  rim.outer = 24;
  rim.laps = 1.6;
  rim.constraint_noise = 0.01;
  rim.outer_observations = false;
  auto wild = rim;
  wild.outliers = 0.1;
  wild.outer_observations = true;
  wild.seed = 5;
  auto graph = rim;
  graph.points_per_keyframe = 0;
  graph.constrain_all = true;
  return {{"Plain", noisy, 0, 0, false},     {"Robust", noisy, 1, 0, false},
          {"FixedPoses", noisy, 1, 0, true}, {"DoubleWindow", rim, 1.5, 0, false},
          {"Outliers", wild, 1.5, 2, false}, {"OutliersFixedPoses", wild, 1.5, 2, true},
          {"PoseGraph", graph, 0, 0, false}, {"PoseGraphRobustFixed", graph, 0, 1, true}};
}
INSTANTIATE_TEST_SUITE_P(Window, EqualToCeres, testing::ValuesIn(ceres_cases()),
                         [](const auto& test) { return test.param.name; });

/// Many poses, few points: the poses are eliminated, with the same result.
TEST(WindowSolver, IsEqualToCeresWithFewPointsToo) {
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
      solver_options.huber_px = huber;
      const double reference = ceres_cost(problem, solver_options);
      auto again = problem;
      WindowSolver solver;
      const SolverSummary summary = solver.solve(problem, solver_options);
      EXPECT_NEAR(summary.final_cost, reference, 1e-6 * reference);
      // In the problem's own form, points relative to their moved anchors.
      EXPECT_NEAR(window_cost(problem, solver_options), summary.final_cost, 1e-9 * reference);
      EXPECT_LT(summary.final_cost, 0.5 * summary.initial_cost);
      if (fixed) {
        EXPECT_EQ(front, problem.poses.front().T_k_w.matrix());
      }
      EXPECT_EQ(WindowSolver().solve(again, solver_options).final_cost, summary.final_cost);
    }
  }
}

}  // namespace
}  // namespace twofold
