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

TEST(ScaleDrift, SphereIsFlownAtOneHeightInEvenSteps) {
  const SphereOptions options{.radius = 5};
  const Scene scene = sphere_scene(options, 1);
  const std::vector<Vector3> centres = camera_centres(scene.T_c_w);
  for (std::size_t k = 0; k < centres.size(); ++k) {
    EXPECT_NEAR(centres[k].norm(), options.radius + options.height, 1e-9);
    EXPECT_LT((scene.T_c_w[k] * Vector3::Zero() - Vector3(0, 0, options.radius + options.height)).norm(),
              1e-9);
    if (k == 0) continue;
    EXPECT_NEAR((centres[k] - centres[k - 1]).norm(), options.step, 0.01 * options.step);
  }
  EXPECT_LT((centres.back() - centres.front()).norm(), options.step);
}

TEST(ScaleDrift, SphereWithoutNoiseIsSolvedExactly) {
  const Scene scene = sphere_scene({.radius = 3}, 2);
  const int last = static_cast<int>(scene.T_c_w.size()) - 1;
  const DriftTrial trial = run_trial(scene, 0, 1, {{0, 3, last}});
  ASSERT_TRUE(trial.ok);
  for (const Method m : {kExplored, kSe3, kSim3}) EXPECT_LT(trial.rmse_centre[m], 1e-3) << m;
}

/// The same points mapped twice, the second time in another unit and from frames with a wrong pose: the loop
/// is their true relative similarity, whatever those frames' place in the map.
TEST(ScaleDrift, LoopBetweenMapsOfDifferentUnitIsFoundExactly) {
  const Scene scene = circle_scene(2, 3);
  const double unit = 1.3;
  const SE3 wrong = SE3::exp((Vector6() << 3, -2, 1, 0.4, -0.2, 0.9).finished());
  const auto true_pose = [&](int k) { return scene.T_c_w[static_cast<std::size_t>(k % 10)]; };
  ExplorationResult map;
  map.seen.resize(20);
  for (int k = 0; k < 20; ++k) {
    const SE3 T = true_pose(k);
    map.T_c_w.push_back(k < 10 ? T : SE3(T.so3(), unit * T.translation()) * wrong.inverse());
  }
  for (const int first : {0, 10}) {
    for (int p = 0; p < static_cast<int>(scene.points.size()); ++p) {
      const Vector3& x = scene.points[static_cast<std::size_t>(p)];
      if ((true_pose(first) * x).z() < 0.2) continue;
      const int track = static_cast<int>(map.tracks.size());
      map.tracks.push_back({.point = p, .first_frame = first, .uv = std::vector<Vector2>(10)});
      map.tracks.back().x_w = first == 0 ? x : wrong * (unit * x);
      for (int k = first; k < first + 10; ++k) map.seen[static_cast<std::size_t>(k)].push_back(track);
    }
  }
  const auto loop = close_loop(scene.rig, map, 2, 3, 14);
  ASSERT_TRUE(loop.has_value());
  const SE3 T_j_i = true_pose(14) * true_pose(2).inverse();
  const Sim3 S_j_i(unit, T_j_i.so3(), unit * T_j_i.translation());
  EXPECT_LT((loop->S_j_i * S_j_i.inverse()).log().norm(), 1e-9);
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
  const double open = scaled_rmse(truth, camera_centres(map.T_c_w), truth[0]);
  const double se3 = scaled_rmse(truth, corrected_centres<SE3>(map, {loop}), truth[0]);
  const double sim3 = scaled_rmse(truth, corrected_centres<Sim3>(map, {loop}), truth[0]);
  EXPECT_LT(sim3, 0.1 * se3) << open;
  EXPECT_LT(sim3, 0.1 * open);
}

TEST(ScaleDrift, RmseIgnoresTheScale) {
  const std::vector<Vector3> truth = {{1, 0, 0}, {0, 1, 0}, {0, 0, 3}};
  std::vector<Vector3> larger;
  for (const Vector3& x : truth) larger.push_back(truth[0] + 2.5 * (x - truth[0]));
  EXPECT_LT(scaled_rmse(truth, larger, truth[0]), 1e-12);
  larger[1].x() += 1;
  EXPECT_GT(scaled_rmse(truth, larger, truth[0]), 0.01);
}

}  // namespace
}  // namespace twofold::bench
