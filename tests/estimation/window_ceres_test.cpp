// The window solver against Ceres on the same cost.
#include <gtest/gtest.h>

#include <vector>

#include "tests/estimation/ceres_cost.hpp"
#include "tests/estimation/window_cases.hpp"

namespace twofold {
namespace {

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
  options.huber_sigmas = GetParam().huber;
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

}  // namespace
}  // namespace twofold
