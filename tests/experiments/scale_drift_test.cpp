// The simulation of bench/experiments/scale_drift: what it finds is only worth as much as its noise-free
// case.
#include <gtest/gtest.h>

#include <cmath>

#include "experiments/scale_drift/trial.hpp"

namespace twofold::bench {
namespace {

TEST(ScaleDrift, CircleWithoutNoiseIsSolvedExactly) {
  const Scene scene = circle_scene(2, 3);
  ASSERT_EQ(scene.T_c_w.size(), 144u);
  const DriftTrial trial = run_trial(scene, 0, 1, {{0, 10, 143}});
  ASSERT_TRUE(trial.ok);
  const LoopConstraint& loop = trial.loops[0];
  EXPECT_NEAR(loop.S_j_i.scale(), 1, 1e-4);
  const SE3 T_j_i = scene.T_c_w[143] * scene.T_c_w[static_cast<std::size_t>(loop.i)].inverse();
  EXPECT_LT((loop.S_j_i * Sim3(T_j_i).inverse()).log().norm(), 1e-3);
  for (const Method m : {kExplored, kSe3, kSim3}) EXPECT_LT(trial.rmse[m], 1e-4) << m;
}

TEST(ScaleDrift, ExplorationDriftsWithNoiseAndAlwaysAlike) {
  const Scene scene = circle_scene(2, 3);
  const DriftTrial a = run_trial(scene, 1, 1, {{0, 10, 143}});
  const DriftTrial b = run_trial(scene, 1, 1, {{0, 10, 143}});
  ASSERT_TRUE(a.ok);
  EXPECT_GT(a.rmse[kExplored], 1e-3);
  EXPECT_EQ(a.rmse, b.rmse);
}

TEST(ScaleDrift, SphereSeesItsNeighbouringTurns) {
  const SphereOptions options{.radius = 5, .turns = 3};
  const Scene scene = sphere_scene(options, 1);
  for (const Vector3& c : camera_centres(scene.T_c_w)) {
    EXPECT_NEAR(c.norm(), options.radius + options.height, 1e-9);
  }
  for (std::size_t k = 1; k < scene.T_c_w.size(); ++k) {  // forward, and no roll
    const SE3 T = scene.T_c_w[k] * scene.T_c_w[k - 1].inverse();
    EXPECT_NEAR(T.translation().norm(), options.step, 0.15 * options.step);
  }
  EXPECT_THROW((void)sphere_scene({.radius = 5, .turns = 100}, 1), std::runtime_error);
}

/// A chain whose unit grows by the same factor at every pose, closed by the true relative similarity: over
/// Sim(3) every pose gets the scale it was measured in, and the circle is round again; over SE(3) it is not.
TEST(ScaleDrift, UniformScaleDriftIsTakenBackOverSim3Only) {
  const Scene scene = circle_scene(2, 1);
  const int n = static_cast<int>(scene.T_c_w.size());
  const double growth = std::log(1.3) / n;
  ExplorationResult map;
  map.T_c_w.push_back(scene.T_c_w[0]);
  for (int k = 1; k < n; ++k) {
    const SE3 T =
        scene.T_c_w[static_cast<std::size_t>(k)] * scene.T_c_w[static_cast<std::size_t>(k) - 1].inverse();
    map.T_c_w.push_back(SE3(T.so3(), std::exp(growth * k) * T.translation()) * map.T_c_w.back());
  }
  const SE3 T_last_first = scene.T_c_w.back() * scene.T_c_w[0].inverse();
  LoopConstraint loop{.i = 0, .j = n - 1, .S_j_i = {}};
  const double s = std::exp(growth * (n - 1));
  loop.S_j_i = Sim3(s, T_last_first.so3(), s * T_last_first.translation());
  const std::vector<Vector3> truth = camera_centres(scene.T_c_w);
  const double open = scaled_rmse(truth, camera_centres(map.T_c_w));
  const double se3 = scaled_rmse(truth, corrected_centres<SE3>(map, {loop}));
  const double sim3 = scaled_rmse(truth, corrected_centres<Sim3>(map, {loop}));
  EXPECT_LT(sim3, 0.1 * se3) << open;
  EXPECT_LT(sim3, 0.1 * open);
}

TEST(ScaleDrift, RmseIgnoresTheScale) {
  const std::vector<Vector3> truth = {{1, 0, 0}, {0, 1, 0}, {0, 0, 3}};
  std::vector<Vector3> larger;
  for (const Vector3& x : truth) larger.push_back(truth[0] + 2.5 * (x - truth[0]));
  EXPECT_LT(scaled_rmse(truth, larger), 1e-12);
  larger[1].x() += 1;
  EXPECT_GT(scaled_rmse(truth, larger), 0.01);
}

}  // namespace
}  // namespace twofold::bench
