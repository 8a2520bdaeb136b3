#include "estimation/focal_length.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "geometry/inverse_depth.hpp"
#include "tests/estimation/window_cases.hpp"

namespace twofold {
namespace {

constexpr double kTolerance = 0.02;

/// Bundle adjustment of a ride along half a circle, solved with a focal length that is `wrong` times the true
/// one.
WindowProblem ride_with_wrong_lens(double wrong, unsigned seed) {
  SyntheticWindowOptions options;
  options.kind = SensorKind::kMono;
  options.inner = 24;
  options.laps = 0.5;
  options.pixel_noise = 0.5;
  options.seed = seed;
  WindowProblem problem = make_synthetic_window(options).truth;
  problem.poses.front().fixed = true;
  problem.rig.camera.fx *= wrong;
  problem.rig.camera.fy *= wrong;
  for (WindowProblem::Point& point : problem.points) point.psi.head<2>() /= wrong;
  WindowSolver().solve(problem, to_convergence());
  return problem;
}

TEST(FocalLength, IsFoundWhereTheRigsIsWrong) {
  for (const double wrong : {0.9, 0.96, 1.05, 1.12}) {
    WindowProblem problem = ride_with_wrong_lens(wrong, 3);
    const double fx = problem.rig.camera.fx, before = window_cost(problem, to_convergence());
    const auto estimate = estimate_focal_length(problem, to_convergence(), kTolerance);
    ASSERT_TRUE(estimate) << wrong;
    EXPECT_LT(estimate->sigma, 0.005);
    EXPECT_NEAR(estimate->scale * wrong, 1, 4 * estimate->sigma) << wrong;
    EXPECT_NEAR(problem.rig.camera.fx, estimate->scale * fx, 0.1 * kTolerance * fx) << "solved with it";
    EXPECT_LT(window_cost(problem, to_convergence()), 0.8 * before);
  }
}

/// Squares of errors in standard deviations: 40 of them have a mean of 1 +- 0.22.
TEST(FocalLength, IsAsExactAsItSays) {
  double sum = 0;
  constexpr unsigned kRides = 40;
  for (unsigned seed = 1; seed <= kRides; ++seed) {
    WindowProblem problem = ride_with_wrong_lens(0.95, seed);
    const auto estimate = estimate_focal_length(problem, to_convergence(), kTolerance);
    ASSERT_TRUE(estimate) << seed;
    sum += std::pow((estimate->scale * 0.95 - 1) / estimate->sigma, 2);
  }
  EXPECT_NEAR(sum / kRides, 1, 3 * 0.22);
}

TEST(FocalLength, LeavesAProblemAloneWhoseRigIsRight) {
  WindowProblem problem = ride_with_wrong_lens(1, 3);
  const WindowProblem before = problem;
  const auto estimate = estimate_focal_length(problem, to_convergence(), kTolerance);
  ASSERT_TRUE(estimate);
  EXPECT_NEAR(estimate->scale, 1, 4 * estimate->sigma);
  EXPECT_EQ(problem.rig.camera.fx, before.rig.camera.fx);
  EXPECT_LT(relative_pose_error(problem, before), 1e-12);
}

/// Without turns, a longer focal length is the same as a world that is longer along the optical axis.
TEST(FocalLength, IsNotShownByMotionWithoutTurns) {
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  WindowProblem problem = ride_with_wrong_lens(1, 3);
  problem.poses.clear(), problem.points.clear(), problem.observations.clear();
  for (int n = 0; n < 10; ++n)
    problem.poses.push_back({SE3(SO3(), {-0.1 * n, 0.02 * n * n, -0.05 * n}), n == 0});
  for (int k = 0; k < 200; ++k) {
    const Vector3 p_w(2 * uniform(rng), 2 * uniform(rng), 6 + 2 * uniform(rng));
    problem.points.push_back({0, to_inverse_depth(p_w), static_cast<int>(problem.observations.size()), 10});
    for (int n = 0; n < 10; ++n) {
      const StereoPixel z = problem.rig.project(problem.poses[static_cast<std::size_t>(n)].T_k_w * p_w);
      WindowProblem::Observation& o = problem.observations.emplace_back();
      o.pose = n;
      o.pixel = {static_cast<float>(z.x() + 0.5 * normal(rng)), static_cast<float>(z.y() + 0.5 * normal(rng)),
                 static_cast<float>(Rig::kNoRight)};
      o.information.z() = 0;
    }
  }
  WindowSolver().solve(problem, to_convergence());
  const auto estimate = estimate_focal_length(problem, to_convergence(), kTolerance);
  EXPECT_TRUE(!estimate || estimate->sigma > kTolerance) << estimate->scale << " +- " << estimate->sigma;
}

}  // namespace
}  // namespace twofold
