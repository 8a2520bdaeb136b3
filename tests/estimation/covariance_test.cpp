#include "estimation/covariance.hpp"

#include <gtest/gtest.h>

#include "estimation/window_solver.hpp"
#include "fixtures/ceres_window.hpp"
#include "fixtures/synthetic_window.hpp"

namespace twofold {
namespace {

WindowProblem fixed_window(unsigned seed, double constraint_noise = 0.005) {
  SyntheticWindowOptions options;
  options.inner = 5;
  options.outer = 4;
  options.points_per_keyframe = 12;
  options.missing_right = 0.3;
  options.pixel_noise = 0.7;
  options.constraint_noise = constraint_noise;
  options.seed = seed;
  WindowProblem problem = make_synthetic_window(options).start;
  problem.poses[0].fixed = true;
  return problem;
}

TEST(WindowCovariance, EqualsCeres) {
  WindowProblem problem = fixed_window(1);
  WindowSolverOptions options;
  options.huber_sigmas = 0;
  options.max_iterations = 50;
  WindowSolver solver;
  solver.solve(problem, options);
  const auto covariance = WindowCovariance::compute(problem, options);
  ASSERT_TRUE(covariance);

  CeresWindow reference(problem, options);
  std::vector<const double*> blocks;
  for (std::size_t i = 0; i < problem.poses.size(); ++i)
    blocks.push_back(reference.pose(static_cast<int>(i)));
  for (std::size_t k = 0; k < problem.points.size(); ++k)
    blocks.push_back(reference.point(static_cast<int>(k)));
  ceres::Covariance ceres_covariance{ceres::Covariance::Options()};
  std::vector<std::pair<const double*, const double*>> pairs;
  for (std::size_t a = 0; a < blocks.size(); ++a) {
    pairs.emplace_back(blocks[a], blocks[a]);
    if (a > 1 && a < problem.poses.size()) pairs.emplace_back(blocks[1], blocks[a]);
  }
  ASSERT_TRUE(ceres_covariance.Compute(pairs, &reference.problem()));
  using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
  for (int i = 0; i < static_cast<int>(problem.poses.size()); ++i) {
    RowMajor6 expected, cross;
    ASSERT_TRUE(ceres_covariance.GetCovarianceBlockInTangentSpace(blocks[i], blocks[i], expected.data()));
    EXPECT_LE((*covariance->pose(i) - expected).norm(), 1e-6 * expected.norm()) << "pose " << i;
    if (i < 2) continue;
    ASSERT_TRUE(ceres_covariance.GetCovarianceBlockInTangentSpace(blocks[1], blocks[i], cross.data()));
    EXPECT_LT((*covariance->poses(1, i) - cross).norm(), 1e-6 * expected.norm()) << "pose " << i;
  }
  EXPECT_EQ(*covariance->pose(0), Matrix6::Zero());
  for (int k = 0; k < static_cast<int>(problem.points.size()); ++k) {
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> expected;
    const double* block = blocks[problem.poses.size() + k];
    ASSERT_TRUE(ceres_covariance.GetCovarianceBlock(block, block, expected.data()));
    EXPECT_LT((*covariance->point(k) - expected).norm(), 1e-6 * expected.norm()) << "point " << k;
  }
}

/// Over many draws of the noise the whitened error of a pose has six degrees of freedom.
TEST(WindowCovariance, PredictsTheErrorOverManyDraws) {
  SyntheticWindowOptions generator;
  generator.inner = 5;
  generator.points_per_keyframe = 12;
  generator.pixel_noise = 1;  // which is what the unit information says
  WindowSolverOptions options;
  options.huber_sigmas = 0;
  options.max_iterations = 20;
  WindowSolver solver;
  double sum = 0;
  constexpr int kDraws = 150;
  for (int n = 0; n < kDraws; ++n) {
    generator.seed = 1000 + n;
    auto window = make_synthetic_window(generator);
    WindowProblem& problem = window.start;
    problem.poses[0] = {window.truth.poses[0].T_k_w, true};
    solver.solve(problem, options);
    const auto covariance = WindowCovariance::compute(problem, options);
    ASSERT_TRUE(covariance);
    const Vector6 error = (problem.poses[4].T_k_w * window.truth.poses[4].T_k_w.inverse()).log();
    sum += error.dot(covariance->pose(4)->llt().solve(error));
  }
  EXPECT_NEAR(sum / kDraws, 6.0, 1.1);  // standard deviation of the mean: sqrt(12 / 150) = 0.28
}

TEST(WindowCovariance, RefusesAFreeGauge) {
  WindowProblem problem = fixed_window(2);
  EXPECT_TRUE(WindowCovariance::compute(problem, {}).has_value());
  problem.poses[0].fixed = false;
  EXPECT_FALSE(WindowCovariance::compute(problem, {}).has_value());
}

TEST(WindowCovariance, RefusesAFreeScale) {
  SyntheticWindowOptions options;
  options.inner = 6;
  options.kind = SensorKind::kMono;
  WindowProblem problem = make_synthetic_window(options).start;
  problem.poses[0].fixed = true;
  EXPECT_FALSE(WindowCovariance::compute(problem, {}).has_value());
  problem.poses[5].fixed = true;
  EXPECT_TRUE(WindowCovariance::compute(problem, {}).has_value());
}

TEST(WindowCovariance, KnowsNothingOfLonelyPosesAndUnseenPoints) {
  WindowProblem problem = fixed_window(3);
  problem.poses.push_back({SE3(), false});
  problem.points[0].observation_count = 0;
  const auto covariance = WindowCovariance::compute(problem, {});
  ASSERT_TRUE(covariance);
  EXPECT_FALSE(covariance->pose(static_cast<int>(problem.poses.size()) - 1).has_value());
  EXPECT_FALSE(covariance->point(0).has_value());
  EXPECT_TRUE(covariance->point(1).has_value());
}

}  // namespace
}  // namespace twofold
