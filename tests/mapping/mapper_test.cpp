#include "mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <climits>
#include <cstring>

#include "tests/graph/graph_invariants.hpp"
#include "tests/mapping/simulation.hpp"

namespace twofold {
namespace {

using simulation::Simulation;

MapperOptions small_windows() {
  MapperOptions options;
  options.inner_window = 15;
  options.outer_window = 50;
  options.sigma_scale = 2;  // one pixel of noise
  options.edge.sigma_px = 1;
  options.culling.keyframes = options.culling.points = false;
  options.loop.enabled = false;
  return options;
}

Simulation spiral(int keyframes, unsigned seed, double outliers = 0, SensorKind kind = SensorKind::kStereo) {
  simulation::Options options;
  options.rig = simulation::thesis_rig(kind);
  options.seed = seed;
  options.outliers = outliers;
  options.max_observations = 120;
  const std::vector<SE3> path = simulation::spiral_path(keyframes, 0.2, 0.8, 1.2);
  return {options, simulation::scattered_points(path, 2, 25, seed), path};
}

MapperReport map_next(Simulation& simulation, Mapper& mapper) {
  KeyframeProposal* proposal = &simulation.propose(mapper.graph());
  return mapper.step(std::span(&proposal, 1));
}

double inner_error(const Mapper& mapper, const Simulation& simulation) {
  const DoubleWindow& window = mapper.window();
  return simulation::relative_error(
             mapper.graph(), simulation,
             [&](KeyframeId i, KeyframeId j) { return window.is_inner(i) && window.is_inner(j); })
      .rmse;
}

TEST(Mapper, RefusesInvalidOptions) {
  MapperOptions options;
  EXPECT_EQ(options.invalid_reason(), "");
  options.inner_window = 0;
  EXPECT_NE(options.invalid_reason().find("inner_window"), std::string::npos);
  EXPECT_THROW(Mapper(simulation::thesis_rig(), options), std::runtime_error);
}

TEST(Mapper, AnEmptyRoundOnAnEmptyMapDoesNothing) {
  Mapper mapper(simulation::thesis_rig(), {});
  const MapperReport report = mapper.step({});
  EXPECT_EQ(report.inserted, 0);
  EXPECT_EQ(mapper.graph().keyframe_count(), 0U);
  EXPECT_EQ(mapper.publish().version(), 1U);
}

TEST(Mapper, KeepsInvariantsAndLowersTheCostInEveryRound) {
  for (const SensorKind kind : {SensorKind::kStereo, SensorKind::kMono}) {
    Simulation simulation = spiral(70, 3, 0.03, kind);
    MapperOptions options = small_windows();
    options.inner_window = 8;
    options.outer_window = 20;
    options.culling = {};
    options.culling.keep_recent = 4;
    options.loop.enabled = true;
    double watched_cost = -1;
    options.watch_problem = [&](const WindowProblem& problem) {
      EXPECT_EQ(invalid_reason(problem), "");
      watched_cost = window_cost(problem, options.solver);
    };
    Mapper mapper(simulation::thesis_rig(kind), options, simulation.search(10));
    std::vector<GraphSnapshot> published;
    while (!simulation.done()) {
      const MapperReport report = map_next(simulation, mapper);
      ASSERT_LE(report.solver.final_cost, report.solver.initial_cost);
      ASSERT_NEAR(watched_cost, report.solver.initial_cost, 1e-9 * watched_cost);
      ASSERT_EQ(broken_invariant(mapper.graph(), 2), "") << "keyframe " << mapper.graph().keyframe_count();
      ASSERT_EQ(component_count(mapper.graph()), 1);
      ASSERT_LE(report.inner_window, options.inner_window);
      ASSERT_LE(report.outer_window, options.outer_window);
      ASSERT_EQ(invalid_reason(mapper.last_problem()), "");
      if (published.size() < 10) published.push_back(mapper.publish());
    }
    for (const GraphSnapshot& snapshot : published) EXPECT_EQ(broken_invariant(snapshot, 2), "");
  }
}

/// Thesis 6.5.1, perfect association: the double window is as accurate near the camera as bundle adjustment
/// over everything.
TEST(Mapper, IsLocallyAsAccurateAsFullBundleAdjustment) {
  double dwo = 0, ba = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (double* sum : {&dwo, &ba}) {
      Simulation simulation = spiral(110, seed);
      MapperOptions options = small_windows();
      if (sum == &ba) options.inner_window = INT_MAX / 4;
      options.solver.huber_px = 0;
      options.outlier_chi2_mono = options.outlier_chi2_stereo = 1e9;
      Mapper mapper(simulation::thesis_rig(), options);
      while (!simulation.done()) {
        map_next(simulation, mapper);
        if (mapper.graph().keyframe_count() < 60 || mapper.graph().keyframe_count() % 5 != 0) continue;
        // The same edges for all: the 15 keyframes nearest to the reference.
        DoubleWindow near;
        SelectionScratch scratch;
        select_double_window(mapper.graph(), small_windows(), scratch, near);
        const double rmse =
            simulation::relative_error(mapper.graph(), simulation, [&](KeyframeId i, KeyframeId j) {
              return near.is_inner(i) && near.is_inner(j);
            }).rmse;
        *sum += rmse * rmse;
      }
    }
  }
  RecordProperty("dwo_over_ba", std::to_string(std::sqrt(dwo / ba)));
  EXPECT_LT(std::sqrt(dwo / ba), 1.05);
}

TEST(Mapper, SameInputGivesTheSameGraphBitForBit) {
  std::vector<std::vector<double>> runs;
  for (int run = 0; run < 2; ++run) {
    Simulation simulation = spiral(40, 5, 0.05);
    MapperOptions options = small_windows();
    options.loop.enabled = true;
    options.culling = {};
    Mapper mapper(simulation::thesis_rig(), options, simulation.search(10));
    while (!simulation.done()) map_next(simulation, mapper);
    std::vector<double>& numbers = runs.emplace_back();
    const GraphSnapshot& graph = mapper.graph();
    for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
      const Matrix4 T = graph.T_k_w(KeyframeId{k}).matrix();
      numbers.insert(numbers.end(), T.data(), T.data() + 16);
    }
    for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
      const Vector3& psi = graph.point(PointId{p}).psi;
      numbers.insert(numbers.end(), psi.data(), psi.data() + 3);
    }
  }
  ASSERT_EQ(runs[0].size(), runs[1].size());
  EXPECT_EQ(std::memcmp(runs[0].data(), runs[1].data(), runs[0].size() * sizeof(double)), 0);
}

TEST(Mapper, RemovesWrongMeasurements) {
  Simulation simulation = spiral(40, 7, 0.05);
  Mapper mapper(simulation::thesis_rig(), small_windows());
  int removed = 0;
  while (!simulation.done()) removed += map_next(simulation, mapper).outliers;
  EXPECT_GT(removed, 40 * 60 * 0.05 * 0.5);
  EXPECT_LT(inner_error(mapper, simulation), 0.02);
}

TEST(Mapper, SeveralProposalsInOneRoundHangOnEachOther) {
  Simulation simulation = spiral(12, 8);
  Mapper mapper(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 8; ++k) map_next(simulation, mapper);
  // The tracker goes on while the mapper is busy: both are tracked against the same map.
  KeyframeProposal first = simulation.propose(mapper.graph());
  KeyframeProposal second = simulation.propose(mapper.graph());
  const SE3 T_second_first = second.T_k_ref * first.T_k_ref.inverse();
  second.reference = first.id;
  second.T_k_ref = T_second_first;
  std::erase_if(second.new_points, [&](const NewPoint& p) { return p.anchor != second.reference; });
  KeyframeProposal* both[] = {&first, &second};
  const MapperReport report = mapper.step(both);
  EXPECT_EQ(report.inserted, 2);
  EXPECT_EQ(mapper.graph().reference(), second.id);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
  EXPECT_EQ(component_count(mapper.graph()), 1);
  EXPECT_LT(inner_error(mapper, simulation), 0.03);
}

TEST(Mapper, ANewMapPartStartsItsOwnWindowAndIsJoinedByALoop) {
  Simulation simulation = spiral(30, 9);
  Mapper mapper(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 15; ++k) map_next(simulation, mapper);
  KeyframeProposal lost;
  lost.id = KeyframeId{15};
  lost.median_depth = 1;
  lost.T_k_ref = SE3(SO3(), {5, 5, 5});
  KeyframeProposal* proposal = &lost;
  MapperReport report = mapper.step(std::span(&proposal, 1));
  EXPECT_EQ(report.inner_window + report.outer_window, 1);
  EXPECT_EQ(component_count(mapper.graph()), 2);

  LoopConstraint loop;
  loop.from = lost.id;
  loop.to = KeyframeId{7};
  loop.inliers = 40;
  loop.T_to_from = SE3(SO3(), {0.1, 0, 0});
  report = mapper.step({}, std::span(&loop, 1));
  EXPECT_EQ(report.loops, 1);
  EXPECT_EQ(component_count(mapper.graph()), 1);
  EXPECT_EQ(report.inner_window, 15);
  const GraphSnapshot& graph = mapper.graph();
  // Before any point is shared across the loop, its constraint holds the two sides together within W1.
  const SE3 T_to_from = graph.T_k_w(loop.to) * graph.T_k_w(loop.from).inverse();
  EXPECT_LT((T_to_from * loop.T_to_from.inverse()).log().norm(), 1e-3);
  EXPECT_EQ(broken_invariant(graph, 2), "");
}

TEST(Mapper, ALoopOfKeyframesThatAreForgottenIsDroppedAndCounted) {
  Simulation simulation = spiral(30, 9);
  Mapper mapper(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 15; ++k) map_next(simulation, mapper);
  GraphWriter writer(mapper.publish());
  std::vector<PointId> points;
  for (const Observation& observation : *writer.graph().keyframe(KeyframeId{7}).observations)
    points.push_back(observation.point);
  remove_keyframe(writer, KeyframeId{7});
  LoopConstraint loop;
  loop.from = writer.graph().reference();
  loop.to = KeyframeId{7};
  loop.T_to_from = writer.graph().T_k_w(loop.to) * writer.graph().T_k_w(loop.from).inverse();
  mapper.adopt(writer.publish());
  EXPECT_EQ(mapper.step({}, std::span(&loop, 1)).loops, 1) << "its heir takes it";
  for (const PointId point : points) writer.cull_point(point);
  writer.forget_heirs(0);
  ASSERT_FALSE(writer.graph().survivor(loop.to));
  mapper.adopt(writer.publish());
  const MapperReport report = mapper.step({}, std::span(&loop, 1), KeyframeId{7});
  EXPECT_EQ(report.loops, 0);
  EXPECT_EQ(report.late_loops, 1);
  EXPECT_EQ(mapper.graph().reference(), loop.from);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
}

TEST(Mapper, TheWindowFormsAroundARevisitedKeyframe) {
  Simulation simulation = spiral(90, 10);
  MapperOptions options = small_windows();
  options.inner_window = 5;
  options.outer_window = 10;
  Mapper mapper(simulation::thesis_rig(), options);
  while (!simulation.done()) map_next(simulation, mapper);
  ASSERT_FALSE(mapper.window().contains(KeyframeId{10}));
  const MapperReport report = mapper.step({}, {}, KeyframeId{10});
  EXPECT_EQ(mapper.graph().reference(), KeyframeId{10});
  EXPECT_EQ(mapper.window().nodes[0].id, KeyframeId{10});
  EXPECT_EQ(report.poses_set, report.inner_window + report.outer_window - 1);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
  EXPECT_LT(inner_error(mapper, simulation), 0.03);
}

TEST(Mapper, GoesOnWithAnAdoptedGraph) {
  Simulation simulation = spiral(40, 12);
  Mapper first(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 25; ++k) map_next(simulation, first);
  const GraphSnapshot saved = first.publish();
  Mapper second(simulation::thesis_rig(), small_windows());
  second.adopt(saved);
  EXPECT_EQ(second.graph().version(), saved.version() + 1);
  while (!simulation.done()) map_next(simulation, second);
  EXPECT_EQ(second.graph().keyframe_count(), 40U);
  EXPECT_EQ(saved.keyframe_count(), 25U);
  EXPECT_EQ(broken_invariant(saved, 2), "");
  EXPECT_EQ(broken_invariant(second.graph(), 2), "");
  EXPECT_EQ(component_count(second.graph()), 1);
  EXPECT_LT(inner_error(second, simulation), 0.03);
}

TEST(Mapper, RelaxingTheWholeMapKeepsTheReferenceAndTheAccuracy) {
  Simulation simulation = spiral(110, 11);
  MapperOptions options = small_windows();
  options.inner_window = 6;
  options.outer_window = 12;
  Mapper mapper(simulation::thesis_rig(), options);
  while (!simulation.done()) map_next(simulation, mapper);
  const SE3 T_ref_w = mapper.graph().T_k_w(mapper.graph().reference());
  const RelaxationReport report = mapper.relax_all();
  EXPECT_EQ(report.parts, 1);
  EXPECT_EQ(report.keyframes, 110);
  EXPECT_LE(report.final_cost, report.initial_cost);
  EXPECT_LT((mapper.graph().T_k_w(mapper.graph().reference()) * T_ref_w.inverse()).log().norm(), 1e-9);
  const auto all = [](KeyframeId, KeyframeId) { return true; };
  EXPECT_LT(simulation::relative_error(mapper.graph(), simulation, all).rmse, 0.015);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
}

}  // namespace
}  // namespace twofold
