#include "bench/experiments/double_window/map_unit.hpp"

#include <gtest/gtest.h>

#include "bench/experiments/double_window/experimental_mapping.hpp"
#include "fixtures/simulation.hpp"
#include "geometry/inverse_depth.hpp"
#include "mapping/mapper.hpp"

namespace twofold::bench {
namespace {

/// Three cameras in a row that see the same twenty points. Keyframe n's disparities are those of a baseline
/// of `baselines[n]` in units of the map.
WindowProblem three_views(const Rig& rig, const std::vector<double>& baselines) {
  WindowProblem problem;
  problem.rig = rig;
  problem.poses.resize(3);
  for (int n = 0; n < 3; ++n) problem.poses[static_cast<std::size_t>(n)].T_k_w = SE3(SO3(), {-0.1 * n, 0, 0});
  for (int p = 0; p < 20; ++p) {
    const Vector3 x(0.04 * p - 0.3, 0.3 - 0.03 * p, 1 + 0.05 * p);
    problem.points.push_back({0, to_inverse_depth(x), static_cast<int>(problem.observations.size()), 3});
    for (int n = 0; n < 3; ++n) {
      Rig seen_by = rig;
      seen_by.baseline = baselines[static_cast<std::size_t>(n)];
      const Vector3 z = seen_by.project(problem.poses[static_cast<std::size_t>(n)].T_k_w * x);
      problem.observations.push_back({n, z.cast<float>(), {1, 1, 1}});
    }
  }
  return problem;
}

DoubleWindow window_of(const std::vector<unsigned>& ids, std::size_t inner) {
  DoubleWindow window;
  window.inner = inner;
  for (const unsigned id : ids) {
    window.position.set(KeyframeId{id}, static_cast<int>(window.nodes.size()));
    window.nodes.push_back({KeyframeId{id}, static_cast<int>(window.nodes.size()) - 1});
  }
  return window;
}

TEST(MapUnit, IsTheRigsBeforeAnythingWasRead) {
  const Rig rig = simulation::thesis_rig();
  EXPECT_EQ(MapUnit().window_baseline(rig), rig.baseline);
  EXPECT_EQ(MapUnit().map_baseline(rig), rig.baseline);
}

TEST(MapUnit, ReadsTheBaselineFromTheDisparitiesOfTheInnerWindow) {
  const Rig rig = simulation::thesis_rig();
  MapUnit unit;
  unit.read(three_views(rig, {0.06, 0.06, 0.09}), window_of({0, 1, 2}, 2));
  EXPECT_NEAR(unit.window_baseline(rig), 0.06, 1e-7);
  EXPECT_NEAR(unit.map_baseline(rig), 0.06, 1e-7);
}

TEST(MapUnit, CountsEachKeyframeOnceByItsLatestReading) {
  const Rig rig = simulation::thesis_rig();
  MapUnit unit, once;
  unit.read(three_views(rig, {0.02, 0.08, 0.05}), window_of({0, 1, 2}, 2));
  for (int n = 0; n < 5; ++n) {
    unit.read(three_views(rig, {0.04, 0.06, 0.05}), window_of({0, 1, 2}, 2));
  }
  once.read(three_views(rig, {0.04, 0.06, 0.05}), window_of({0, 1, 2}, 2));
  EXPECT_NEAR(unit.map_baseline(rig), once.map_baseline(rig), 1e-12);
  // The inner window moves on: keyframes 0 and 1 keep what they said, 3 and 4 join.
  unit.read(three_views(rig, {0.08, 0.08, 0.05}), window_of({3, 4, 1}, 2));
  EXPECT_NEAR(unit.window_baseline(rig), 0.08, 1e-7);
  EXPECT_NEAR(unit.map_baseline(rig), 0.5 * (once.map_baseline(rig) + 0.08), 1e-6);
}

TEST(MapUnit, ScalesAMapOfWrongScaleWithoutBendingIt) {
  simulation::Simulation simulation = simulation::noise_free_spiral();
  MapperOptions mapper_options;
  mapper_options.inner_window = 15;
  mapper_options.outer_window = 50;
  mapper_options.culling.keyframes = mapper_options.loop.enabled = false;
  const auto hook = std::make_shared<ExperimentalMapping>(simulation.rig(), mapper_options,
                                                          ExperimentalMappingOptions{.own_unit = true});
  mapper_options.hook = hook;
  Mapper mapper(simulation.rig(), mapper_options);
  const auto map_next = [&] {
    KeyframeProposal* proposal = &simulation.propose(mapper.graph());
    (void)mapper.step(std::span(&proposal, 1));
  };
  for (int k = 0; k < 12; ++k) map_next();
  EXPECT_NEAR(hook->metres_per_unit(), 1, 1e-3);
  GraphWriter writer(mapper.graph());
  constexpr double kScale = 1.02;
  for (std::uint32_t k = 0; k < writer.graph().keyframe_count(); ++k) {
    const SE3& T_k_w = writer.graph().keyframe(KeyframeId{k}).T_k_w;
    writer.set_pose(KeyframeId{k}, SE3(T_k_w.so3(), kScale * T_k_w.translation()));
  }
  for (std::uint32_t p = 0; p < writer.graph().point_count(); ++p) {
    const Vector3& psi = writer.graph().point(PointId{p}).psi;
    writer.set_inverse_depth(PointId{p}, {psi.x(), psi.y(), psi.z() / kScale});
  }
  mapper.continue_from(writer.publish());
  while (!simulation.done()) map_next();
  // The unit has stayed, and in metres the map is right wherever it is.
  EXPECT_NEAR(hook->metres_per_unit(), 1 / kScale, 2e-3);
  double worst = 0;
  for (std::uint32_t k = 1; k < mapper.graph().keyframe_count(); ++k) {
    const KeyframeId i{k}, j{k - 1};
    const SE3 T_i_j = mapper.graph().T_k_w(i) * mapper.graph().T_k_w(j).inverse();
    const SE3 T_true = simulation.true_pose(i) * simulation.true_pose(j).inverse();
    worst = std::max(worst, (hook->metres_per_unit() * T_i_j.translation() - T_true.translation()).norm());
  }
  EXPECT_LT(worst, 0.2 * 2e-3);  // of steps of 0.2 m; a map bent between the two scales would be off by 0.02
}

}  // namespace
}  // namespace twofold::bench
