#include "estimation/window_solver.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/estimation/window_cases.hpp"

namespace twofold {
namespace {

TEST(WindowSolver, FindsTruthFromExactStereoMeasurements) {
  auto [truth, start] = make_synthetic_window(small_window());
  ASSERT_GT(truth.points.size(), 100u);
  WindowSolver solver;
  const SolverSummary summary = solver.solve(start, to_convergence());
  // Measurements are stored as float: 640 px carry an error of about 3e-5 px.
  EXPECT_LT(summary.final_cost, 1e-9 * static_cast<double>(truth.observations.size()));
  EXPECT_LT(relative_pose_error(start, truth), 1e-6);
  for (std::size_t k = 0; k < truth.points.size(); ++k) {
    EXPECT_LT((start.points[k].psi - truth.points[k].psi).norm(), 1e-5);
  }
}

TEST(WindowSolver, FindsTruthWithMissingRightImages) {
  auto options = small_window();
  options.missing_right = 0.5;
  auto [truth, start] = make_synthetic_window(options);
  WindowSolver solver;
  const SolverSummary summary = solver.solve(start, to_convergence());
  EXPECT_LT(summary.final_cost, 1e-9 * static_cast<double>(truth.observations.size()));
  EXPECT_LT(relative_pose_error(start, truth), 1e-6);
}

TEST(WindowSolver, FindsTruthMonocularUpToScale) {
  auto options = small_window();
  options.kind = SensorKind::kMono;
  auto [truth, start] = make_synthetic_window(options);
  WindowSolver solver;
  const SolverSummary summary = solver.solve(start, to_convergence());
  EXPECT_LT(summary.final_cost, 1e-8 * static_cast<double>(truth.observations.size()));
}

TEST(WindowSolver, IsRobustToOneFifthOutliers) {
  auto options = small_window();
  options.pixel_noise = 0.5;
  auto [truth, clean_start] = make_synthetic_window(options);
  options.outliers = 0.2;
  auto [truth_2, start] = make_synthetic_window(options);
  auto robust = start, plain = start;
  WindowSolver solver;
  auto solver_options = to_convergence();
  solver_options.huber_sigmas = 1;
  solver.solve(robust, solver_options);
  solver_options.huber_sigmas = 0;
  solver.solve(plain, solver_options);
  EXPECT_LT(relative_pose_error(robust, truth_2), 0.03);
  EXPECT_LT(relative_pose_error(robust, truth_2), 0.2 * relative_pose_error(plain, truth_2));
}

TEST(WindowSolver, CostNeverRisesAndSummaryIsTrue) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    auto options = small_window();
    options.seed = seed;
    options.outer = 12;
    options.outliers = 0.1;
    options.pixel_noise = 1;
    options.start_pose_noise = 0.3;  // far off: some steps must fail
    options.start_depth_noise = 0.5;
    auto window = make_synthetic_window(options);
    WindowProblem& problem = window.start;
    WindowSolver solver;
    WindowSolverOptions one_step;
    one_step.max_iterations = 1;
    for (int n = 0; n < 10; ++n) {
      const SolverSummary summary = solver.solve(problem, one_step);
      EXPECT_LE(summary.final_cost, summary.initial_cost) << "seed " << seed;
      EXPECT_EQ(summary.accepted_steps == 1, summary.final_cost < summary.initial_cost);
    }
  }
}

TEST(WindowSolver, RefusedStepsLeaveTheProblemAsItWas) {
  auto options = small_window();
  auto [truth, start] = make_synthetic_window(options);
  WindowSolver solver;
  SolverSummary summary;
  WindowProblem before;
  for (int n = 0; n < 100; ++n) {  // until rounding finds no better place either
    before = start;
    summary = solver.solve(start, to_convergence());
    if (summary.accepted_steps == 0) break;
  }
  ASSERT_EQ(summary.accepted_steps, 0);
  EXPECT_EQ(summary.final_cost, summary.initial_cost);
  for (std::size_t i = 0; i < start.poses.size(); ++i) {
    EXPECT_EQ(before.poses[i].T_k_w.matrix(), start.poses[i].T_k_w.matrix());
  }
  for (std::size_t k = 0; k < start.points.size(); ++k) EXPECT_EQ(before.points[k].psi, start.points[k].psi);
}

/// eq. 6.4 depends on poses through T_i T_j^-1 only: moving the world changes nothing.
TEST(WindowSolver, IsGaugeInvariant) {
  auto options = small_window();
  options.outer = 12;
  options.pixel_noise = 0.5;
  auto window = make_synthetic_window(options);
  WindowProblem here = window.start, there = window.start;
  Vector6 far;
  far << 20, -30, 10, 0.5, 1, -2;
  const SE3 T_w_v = SE3::exp(far);
  for (auto& pose : there.poses) pose.T_k_w = pose.T_k_w * T_w_v;
  WindowSolver solver;
  const auto summary_here = solver.solve(here, to_convergence());
  const auto summary_there = solver.solve(there, to_convergence());
  EXPECT_NEAR(summary_here.initial_cost, summary_there.initial_cost, 1e-9 * summary_here.initial_cost);
  EXPECT_NEAR(summary_here.final_cost, summary_there.final_cost, 1e-9 * summary_here.final_cost);
  EXPECT_LT(relative_pose_error(here, there), 1e-5);
}

TEST(WindowSolver, IsDeterministicAlsoWithUsedBuffers) {
  auto options = small_window();
  options.outer = 12;
  options.pixel_noise = 0.5;
  auto window = make_synthetic_window(options);
  options.seed = 9;
  auto other = make_synthetic_window(options);
  WindowSolver fresh, used;
  used.solve(other.start, {});
  WindowProblem a = window.start, b = window.start;
  const auto summary_a = fresh.solve(a, {});
  const auto summary_b = used.solve(b, {});
  EXPECT_EQ(summary_a.final_cost, summary_b.final_cost);
  for (std::size_t i = 0; i < a.poses.size(); ++i) {
    EXPECT_EQ(a.poses[i].T_k_w.matrix(), b.poses[i].T_k_w.matrix());
  }
  for (std::size_t k = 0; k < a.points.size(); ++k) EXPECT_EQ(a.points[k].psi, b.points[k].psi);
}

TEST(WindowSolver, LeavesOutObservationsBehindTheCamera) {
  auto window = make_synthetic_window(small_window());
  WindowProblem problem = window.truth;
  // A false match with a point which is behind camera 0.
  WindowProblem::Point point;
  point.anchor = 3;
  point.psi =
      to_inverse_depth(problem.poses[3].T_k_w * (problem.poses[0].T_k_w.inverse() * Vector3(0, 0, 1)));
  point.first_observation = static_cast<int>(problem.observations.size());
  problem.observations.push_back(
      {3, problem.rig.project(from_inverse_depth(point.psi)).cast<float>(), {1, 1, 1}});
  problem.poses.push_back(
      {SE3(SO3::exp({0, std::numbers::pi, 0}), {0, 0, 0}) * problem.poses[0].T_k_w, false});
  problem.observations.push_back({static_cast<int>(problem.poses.size()) - 1, {300, 200, 290}, {1, 1, 1}});
  point.observation_count = 2;
  problem.points.push_back(point);
  ASSERT_FALSE(
      std::isfinite(observation_chi2(problem, position_w(problem, point), problem.observations.back())));
  const SE3 lonely = problem.poses.back().T_k_w;
  WindowSolver solver;
  const auto summary = solver.solve(problem, to_convergence());
  EXPECT_TRUE(std::isfinite(summary.initial_cost));
  EXPECT_LT(summary.final_cost, 1e-6);
  EXPECT_EQ(lonely.matrix(), problem.poses.back().T_k_w.matrix()) << "nothing ties this pose to anything";
}

TEST(WindowSolver, LeavesOutAPoseThatHasAllItsPointsBehindIt) {
  auto window = make_synthetic_window(small_window());
  WindowProblem& problem = window.start;
  // Turned half around about its vertical axis: it is still tied to a neighbour by a pose-pose constraint
  // alone.
  SE3& T_k_w = problem.poses[2].T_k_w;
  T_k_w = SE3(SO3::exp(Vector3(0, 3.14159, 0)), Vector3::Zero()) * T_k_w;
  problem.constraints.push_back({2, 3, problem.poses[3].T_k_w * T_k_w.inverse()});
  WindowSolver solver;
  const auto summary = solver.solve(problem, to_convergence());
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  EXPECT_TRUE(problem.poses[2].T_k_w.matrix().allFinite());
}

TEST(WindowSolver, HoldsPointsAtInfinity) {
  auto window = make_synthetic_window(small_window());
  WindowProblem problem = window.truth;
  for (std::size_t n = 0; n < 20; ++n) {  // disparity of the wrong sign: the best depth is beyond infinity
    auto& point = problem.points[n];
    for (int m = 0; m < point.observation_count; ++m) {
      auto& o = problem.observations[point.first_observation + m];
      o.pixel = problem.rig.project(Vector3(0.1, 0.2, 1) * 1e6).cast<float>() + Eigen::Vector3f(0, 0, 3);
    }
  }
  WindowSolver solver;
  const auto summary = solver.solve(problem, to_convergence());
  EXPECT_LT(summary.final_cost, summary.initial_cost);
  for (const auto& point : problem.points) EXPECT_GE(point.psi.z(), 1e-6);
}

TEST(WindowSolver, EmptyAndFullyHeldProblems) {
  WindowSolver solver;
  WindowProblem empty;
  EXPECT_EQ(solver.solve(empty, {}).termination, SolverSummary::Termination::kEmptyProblem);
  auto window = make_synthetic_window(small_window());
  WindowProblem& held = window.start;
  for (std::size_t i = 0; i < held.poses.size(); ++i) held.poses[i] = {window.truth.poses[i].T_k_w, true};
  const auto summary = solver.solve(held, to_convergence());
  EXPECT_LT(summary.final_cost, 1e-6);
  for (std::size_t i = 0; i < held.poses.size(); ++i) {
    EXPECT_EQ(held.poses[i].T_k_w.matrix(), window.truth.poses[i].T_k_w.matrix());
  }
}

TEST(WindowProblemDeathTest, InvalidProblemsAreNamed) {
  auto window = make_synthetic_window(small_window());
  EXPECT_EQ(invalid_reason(window.start), "");
  WindowProblem bad = window.start;
  bad.points[3].anchor = 99;
  EXPECT_EQ(invalid_reason(bad), "point 3: anchor is no pose");
  bad = window.start;
  bad.observations[7].pose = -1;
  EXPECT_EQ(invalid_reason(bad), "observation 7: no such pose");
  bad = window.start;
  bad.points[2].observation_count = 1 << 30;
  EXPECT_EQ(invalid_reason(bad), "point 2: observations out of range");
  WindowSolver solver;
  EXPECT_DEATH(solver.solve(bad, {}), "check failed");
}

}  // namespace
}  // namespace twofold
