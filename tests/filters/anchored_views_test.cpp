// Bundle adjustment of a monocular start against the window solver.
#include "filters/anchored_views.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <limits>
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

Start make_start(int points, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> x(-0.8, 0.8), z(1.8, 2.6);
  Start start;
  start.views.camera = {500, 510, 319.5, 239.5, 640, 480};
  start.views.sigma_px = kSigma;
  Rig& rig = start.problem.rig;
  rig.kind = SensorKind::kMono;
  rig.camera = start.views.camera;
  rig.noise.sigma_px = kSigma;
  start.problem.poses.resize(3);
  start.problem.poses[0].fixed = true;
  start.views.views.resize(2);
  const auto w = static_cast<float>(1 / (kSigma * kSigma));
  const Eigen::Vector3f information(w, w, 0);
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
        start.views.views[static_cast<std::size_t>(k - 1)].pixels.emplace_back(z_k.head<2>());
        continue;
      }
      const InverseDepthFilter own = InverseDepthFilter::from_mono(rig.camera, z_k.head<2>(), kSigma);
      point.psi = own.psi;
      start.views.points.push_back({own.psi, own.psi, own.information});
    }
    start.problem.points.push_back(point);
  }
  return start;
}

/// The views after a step of [points | poses], left perturbations.
AnchoredViews moved(AnchoredViews views, const Eigen::VectorXd& step) {
  for (AnchoredViews::Point& point : views.points)
    point.psi += step.segment<3>(3 * (&point - views.points.data()));
  const auto poses = static_cast<Eigen::Index>(3 * views.points.size());
  for (AnchoredViews::View& view : views.views)
    view.T_c_a = SE3::exp(step.segment<6>(poses + 6 * (&view - views.views.data()))) * view.T_c_a;
  return views;
}

constexpr int kPoints = 13;  // no multiple of how many are worked on at once

/// Whoever needs no minimum to the last digit says so, and is done in fewer steps.
TEST(AnchoredViews, EndsWithAStepThatGainsLessThanIsAskedFor) {
  Start exact = make_start(40, 1);
  Start rough = exact;
  const double before = exact.views.cost();
  ASSERT_TRUE(exact.views.minimise(60));
  ASSERT_TRUE(rough.views.minimise(60, before));
  EXPECT_LT(rough.views.cost(), before);
  EXPECT_GT(rough.views.cost(), 1.001 * exact.views.cost());
  ASSERT_TRUE(rough.views.minimise(60, 1e-2));
  EXPECT_NEAR(rough.views.cost(), exact.views.cost(), 0.1);
}

TEST(AnchoredViews, ReachesTheMinimumOfTheWindowSolver) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    Start start = make_start(41, seed);
    ASSERT_TRUE(start.views.minimise(60));
    WindowSolverOptions options;
    options.huber_sigmas = 0;
    options.max_iterations = 200;
    options.relative_decrease = 1e-12;
    // Both from the same poses: scale is free, and the way to the minimum is not the question.
    for (std::size_t k = 0; k < 2; ++k) start.problem.poses[k + 1].T_k_w = start.views.views[k].T_c_a;
    for (std::size_t j = 0; j < 41; ++j) start.problem.points[j].psi = start.views.points[j].psi;
    WindowSolver solver;
    const SolverSummary summary = solver.solve(start.problem, options);
    EXPECT_NEAR(start.views.cost(), summary.final_cost, 1e-5 * summary.final_cost) << seed;
    EXPECT_NEAR(summary.initial_cost, summary.final_cost, 1e-5 * summary.final_cost) << seed;
  }
}

TEST(AnchoredViews, InformationIsTheCurvatureOfTheCost) {
  Start start = make_start(kPoints, 9);
  // Without noise at the minimum the second derivative of the cost is all J^T W J.
  for (std::size_t k = 0; k < 2; ++k) {
    AnchoredViews::View& view = start.views.views[k];
    view.T_c_a = SE3(SO3::exp(Vector3(0, 0.02, 0)), Vector3(-0.1 * (static_cast<double>(k) + 1), 0, 0.01));
    for (std::size_t j = 0; j < view.pixels.size(); ++j) {
      const auto p = project_inverse_depth(start.problem.rig, view.T_c_a, start.views.points[j].psi);
      view.pixels[j] = p->z_hat.head<2>();
    }
  }
  const Eigen::MatrixXd H = start.views.information();
  ASSERT_EQ(H.rows(), 3 * kPoints + 12);
  EXPECT_LT((H - H.transpose()).norm(), 1e-9 * H.norm());
  std::mt19937 rng(4);
  std::normal_distribution<double> normal(0, 1);
  for (int direction = 0; direction < 20; ++direction) {
    Eigen::VectorXd step(H.rows());
    for (Eigen::Index i = 0; i < step.size(); ++i) step[i] = 1e-5 * normal(rng);
    const double curvature = step.dot(H * step);
    EXPECT_NEAR(moved(start.views, step).cost(), curvature, 2e-3 * curvature);
  }
}

/// Points eliminated, four at a time, or all unknowns at once.
TEST(AnchoredViews, StepIsThatOfTheDenseNormalEquations) {
  const AnchoredViews before = make_start(kPoints, 5).views;
  Eigen::MatrixXd H = before.information();
  H.diagonal() += 1e-6 * (H.diagonal().array() + 1).matrix();  // the damping that is tried first
  Eigen::VectorXd g(H.rows());
  for (Eigen::Index i = 0; i < g.size(); ++i) {
    const Eigen::VectorXd d = 1e-6 * Eigen::VectorXd::Unit(g.size(), i);
    g[i] = -(moved(before, d).cost() - moved(before, -d).cost()) / 4e-6;
  }
  const AnchoredViews expected = moved(before, H.ldlt().solve(g));
  AnchoredViews after = before;
  ASSERT_TRUE(after.minimise(1));
  ASSERT_LT(expected.cost(), before.cost());
  EXPECT_NEAR(after.cost(), expected.cost(), 1e-5 * expected.cost());
  for (std::size_t j = 0; j < kPoints; ++j)
    EXPECT_LT((after.points[j].psi - expected.points[j].psi).norm(), 1e-4) << j;
  for (std::size_t k = 0; k < 2; ++k) {
    const SE3 difference = after.views[k].T_c_a * expected.views[k].T_c_a.inverse();
    EXPECT_LT(difference.log().norm(), 1e-4) << k;
  }
}

TEST(AnchoredViews, WorstErrorIsThatOfTheViewThatFitsLeast) {
  Start start = make_start(kPoints, 8);
  AnchoredViews& views = start.views;
  views.points[3].psi_prior.x() += 1;  // far from its prior
  views.points[7].psi << 0.1, 0.1, 4;  // far from where both views see it
  views.points[12].psi << 0, 0, -1e6;  // behind them
  views.views[1].T_c_a.translation().z() = 0.1;
  const std::vector<double> worst = views.worst_errors();
  ASSERT_EQ(worst.size(), views.points.size());
  for (std::size_t j = 0; j < worst.size(); ++j) {
    const AnchoredViews::Point& point = views.points[j];
    const Vector3 x = point.psi - point.psi_prior;
    double expected = x.dot(point.prior * x);
    for (const AnchoredViews::View& view : views.views) {
      const auto p = project_inverse_depth(start.problem.rig, view.T_c_a, point.psi);
      expected = std::max(expected, p ? ((p->z_hat.head<2>() - view.pixels[j]) / kSigma).squaredNorm()
                                      : std::numeric_limits<double>::infinity());
    }
    if (std::isinf(expected)) {
      EXPECT_TRUE(std::isinf(worst[j])) << j;
    } else {
      EXPECT_NEAR(worst[j], expected, 1e-9 * expected) << j;
    }
  }
  EXPECT_TRUE(std::isinf(worst[12]));
}

TEST(AnchoredViews, ScaleIsTheDistanceOfTheFirstView) {
  Start start = make_start(20, 3);
  ASSERT_TRUE(start.views.minimise(60));
  const double cost = start.views.cost();
  ASSERT_TRUE(start.views.normalise_scale());
  EXPECT_NEAR(start.views.views[0].T_c_a.translation().norm(), 1, 1e-12);
  EXPECT_NEAR(start.views.cost(), cost, 1e-9 * cost);
  start.views.views[0].T_c_a = SE3();
  EXPECT_FALSE(start.views.normalise_scale());
}

TEST(AnchoredViews, PointsBehindACameraAreSaid) {
  Start start = make_start(20, 3);
  start.views.views[1].T_c_a = SE3(SO3::exp(Vector3(0, 3, 0)), Vector3(0, 0, 0));
  EXPECT_TRUE(std::isinf(start.views.cost()));
  EXPECT_EQ(start.views.information().size(), 0);
  EXPECT_FALSE(start.views.minimise(10));
}

}  // namespace
}  // namespace twofold
