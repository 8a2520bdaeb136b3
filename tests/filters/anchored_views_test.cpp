// Bundle adjustment of a monocular start against the window solver.
#include "filters/anchored_views.hpp"

#include <gtest/gtest.h>

#include <random>

#include "estimation/window_solver.hpp"
#include "filters/inverse_depth_filter.hpp"

namespace twofold {
namespace {

constexpr double kSigma = 0.5;

struct Start {
  AnchoredViews views;
  WindowProblem problem;  ///< the same measurements, the anchor frame's among them
};

Start make_start(SensorKind kind, int points, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> x(-0.8, 0.8), z(1.8, 2.6);
  Start start;
  Rig& rig = start.views.rig;
  rig.kind = kind;
  rig.camera = {500, 500, 319.5, 239.5, 640, 480};
  rig.baseline = 0.1;
  rig.noise.sigma_px = kSigma;
  start.problem.rig = rig;
  start.problem.poses.resize(3);
  start.problem.poses[0].fixed = true;
  start.views.views.resize(2);
  const auto w = static_cast<float>(1 / (kSigma * kSigma));
  const Eigen::Vector3f information(w, w, kind == SensorKind::kMono ? 0.0F : w);
  for (int i = 0; i < points; ++i) {
    const Vector3 x_a(x(rng), x(rng), z(rng));
    WindowProblem::Point point;
    point.first_observation = static_cast<int>(start.problem.observations.size());
    point.observation_count = 3;
    for (int k = 0; k < 3; ++k) {
      const SE3 T_w_c(SO3::exp(Vector3(0.01 * k, -0.02 * k, 0)), Vector3(0.1 * k, 0.01 * k * k, 0.02 * k));
      const Vector3 noise(normal(rng), normal(rng), normal(rng));
      const Vector3 z_k = rig.project(T_w_c.inverse() * x_a) + kSigma * noise;
      start.problem.observations.push_back({k, z_k.cast<float>(), information});
      if (k > 0) {
        start.views.views[static_cast<std::size_t>(k - 1)].seen.push_back({i, z_k});
        continue;
      }
      const InverseDepthFilter own = kind == SensorKind::kMono
                                         ? InverseDepthFilter::from_mono(rig.camera, z_k.head<2>(), kSigma)
                                         : InverseDepthFilter::from_stereo(rig, z_k, kSigma);
      point.psi = own.psi;
      start.views.points.push_back({own.psi, own.psi, own.information});
    }
    start.problem.points.push_back(point);
  }
  return start;
}

/// Whoever needs no minimum to the last digit says so, and is done in fewer steps.
TEST(AnchoredViews, EndsWithAStepThatGainsLessThanIsAskedFor) {
  Start exact = make_start(SensorKind::kMono, 40, 1);
  Start rough = exact;
  const double before = exact.views.cost();
  ASSERT_TRUE(exact.views.minimise(60));
  ASSERT_TRUE(rough.views.minimise(60, before));
  EXPECT_LT(rough.views.cost(), before);
  EXPECT_GT(rough.views.cost(), 1.001 * exact.views.cost());
  ASSERT_TRUE(rough.views.minimise(60, 1e-2));
  EXPECT_NEAR(rough.views.cost(), exact.views.cost(), 0.1);
}

class AnchoredViewsTest : public ::testing::TestWithParam<SensorKind> {};

TEST_P(AnchoredViewsTest, ReachesTheMinimumOfTheWindowSolver) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Start start = make_start(GetParam(), 40, seed);
    ASSERT_TRUE(start.views.minimise(60));
    WindowSolverOptions options;
    options.huber_sigmas = 0;
    options.max_iterations = 200;
    options.relative_decrease = 1e-12;
    // Both from the same poses: scale is free, and the way to the minimum is not the question.
    for (std::size_t k = 0; k < 2; ++k) start.problem.poses[k + 1].T_k_w = start.views.views[k].T_c_a;
    for (std::size_t j = 0; j < 40; ++j) start.problem.points[j].psi = start.views.points[j].psi;
    WindowSolver solver;
    const SolverSummary summary = solver.solve(start.problem, options);
    // A stereo prior is the measurement linearised; a monocular one is the measurement itself.
    const double tolerance = GetParam() == SensorKind::kMono ? 1e-5 : 0.01;
    EXPECT_NEAR(start.views.cost(), summary.final_cost, tolerance * summary.final_cost) << seed;
    EXPECT_NEAR(summary.initial_cost, summary.final_cost, tolerance * summary.final_cost) << seed;
  }
}

TEST_P(AnchoredViewsTest, InformationIsTheCurvatureOfTheCost) {
  Start start = make_start(GetParam(), 12, 9);
  // Without noise at the minimum the second derivative of the cost is all J^T W J.
  for (std::size_t k = 0; k < 2; ++k) {
    AnchoredViews::View& view = start.views.views[k];
    view.T_c_a = SE3(SO3::exp(Vector3(0, 0.02, 0)), Vector3(-0.1 * (static_cast<double>(k) + 1), 0, 0.01));
    for (SeenPoint& seen : view.seen) {
      const auto j = static_cast<std::size_t>(seen.point);
      seen.pixel = project_inverse_depth(start.views.rig, view.T_c_a, start.views.points[j].psi)->z_hat;
    }
  }
  const Eigen::MatrixXd H = start.views.information();
  ASSERT_EQ(H.rows(), 12 * 3 + 12);
  EXPECT_LT((H - H.transpose()).norm(), 1e-9 * H.norm());
  std::mt19937 rng(4);
  std::normal_distribution<double> normal(0, 1);
  for (int direction = 0; direction < 20; ++direction) {
    Eigen::VectorXd step(H.rows());
    for (Eigen::Index i = 0; i < step.size(); ++i) step[i] = 1e-5 * normal(rng);
    AnchoredViews moved = start.views;
    for (std::size_t j = 0; j < 12; ++j) moved.points[j].psi += step.segment<3>(3 * static_cast<int>(j));
    for (std::size_t k = 0; k < 2; ++k) {
      moved.views[k].T_c_a = SE3::exp(step.segment<6>(36 + 6 * static_cast<int>(k))) * moved.views[k].T_c_a;
    }
    const double curvature = step.dot(H * step);
    EXPECT_NEAR(moved.cost(), curvature, 2e-3 * curvature);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, AnchoredViewsTest, ::testing::Values(SensorKind::kMono, SensorKind::kStereo));

TEST(AnchoredViewsTest, ScaleIsTheDistanceOfTheFirstView) {
  Start start = make_start(SensorKind::kMono, 20, 3);
  ASSERT_TRUE(start.views.minimise(60));
  const double cost = start.views.cost();
  ASSERT_TRUE(start.views.normalise_scale());
  EXPECT_NEAR(start.views.views[0].T_c_a.translation().norm(), 1, 1e-12);
  EXPECT_NEAR(start.views.cost(), cost, 1e-9 * cost);
  start.views.views[0].T_c_a = SE3();
  EXPECT_FALSE(start.views.normalise_scale());
}

TEST(AnchoredViewsTest, PointsBehindACameraAreSaid) {
  Start start = make_start(SensorKind::kMono, 20, 3);
  start.views.views[1].T_c_a = SE3(SO3::exp(Vector3(0, 3, 0)), Vector3(0, 0, 0));
  EXPECT_TRUE(std::isinf(start.views.cost()));
  EXPECT_EQ(start.views.information().size(), 0);
  EXPECT_FALSE(start.views.minimise(10));
}

}  // namespace
}  // namespace twofold
