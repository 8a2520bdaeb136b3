#include "mapping/mapper.hpp"

#include <gtest/gtest.h>

#include <climits>
#include <cmath>
#include <cstring>

#include "fixtures/graph_invariants.hpp"
#include "mapping/mapper_hook.hpp"
#include "tests/mapping/spiral_rounds.hpp"

namespace twofold {
namespace {

using simulation::inner_error;
using simulation::map_next;
using simulation::Simulation;
using simulation::small_windows;
using simulation::spiral;

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

/// The cost before and after the joint optimisation, by another way than the solver's.
struct WatchCost : MapperHook {
  explicit WatchCost(const WindowSolverOptions& options) : solver(options) {}
  void before_solve(const DoubleWindow&, WindowProblem& problem) override {
    EXPECT_EQ(invalid_reason(problem), "");
    before = window_cost(problem, solver);
  }
  void after_solve(const DoubleWindow&, const WindowProblem& problem) override {
    after = window_cost(problem, solver);
  }

  WindowSolverOptions solver;
  double before = -1, after = -1;
};

TEST(Mapper, KeepsInvariantsAndLowersTheCostInEveryRound) {
  for (const SensorKind kind : {SensorKind::kStereo, SensorKind::kMono}) {
    Simulation simulation = spiral(70, 3, 0.03, kind);
    MapperOptions options = small_windows();
    options.inner_window = 8;
    options.outer_window = 20;
    options.culling = {};
    options.culling.keep_recent = 4;
    options.loop.enabled = true;
    const auto watch = std::make_shared<WatchCost>(options.solver);
    options.hook = watch;
    Mapper mapper(simulation::thesis_rig(kind), options, simulation.search(10));
    std::vector<GraphSnapshot> published;
    while (!simulation.done()) {
      const MapperReport report = map_next(simulation, mapper);
      ASSERT_LE(report.solver.final_cost, report.solver.initial_cost);
      ASSERT_NEAR(watch->before, report.solver.initial_cost, 1e-9 * watch->before);
      ASSERT_NEAR(watch->after, report.solver.final_cost, 1e-9 * watch->after);
      ASSERT_EQ(broken_invariant(mapper.graph(), 2), "") << "keyframe " << mapper.graph().keyframe_count();
      ASSERT_EQ(component_count(mapper.graph()), 1);
      ASSERT_LE(report.inner_window, options.inner_window);
      ASSERT_LE(report.outer_window, options.outer_window);
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
      options.solver.huber_sigmas = 0;
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

/// What a round leaves to gain is less than anybody sees, and the next round knows: it takes one step. The
/// camera is as exact as with all steps.
TEST(Mapper, EndsARoundWhenAStepGainsLessThanNoise) {
  double squared_error = 0, squared_error_of_all_steps = 0;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    for (double* sum : {&squared_error, &squared_error_of_all_steps}) {
      Simulation simulation = spiral(60, seed, 0, SensorKind::kMono);
      MapperOptions options = small_windows();
      if (sum == &squared_error_of_all_steps) options.one_camera_decrease = 0;
      Mapper mapper(simulation::thesis_rig(SensorKind::kMono), options);
      int rounds = 0, ended_early = 0;
      while (!simulation.done()) {
        map_next(simulation, mapper);
        ended_early += mapper.step({}).solver.iterations == 1;
        if (++rounds >= 30) *sum += std::pow(inner_error(mapper, simulation), 2);
      }
      if (sum == &squared_error) {
        EXPECT_GT(ended_early, rounds / 2) << seed;
      }
    }
  }
  EXPECT_NEAR(std::sqrt(squared_error / squared_error_of_all_steps), 1, 0.02);
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
  std::erase_if(second.points, [&](const ProposedPoint& p) { return p.anchor != second.reference; });
  KeyframeProposal* both[] = {&first, &second};
  const MapperReport report = mapper.step(both);
  EXPECT_EQ(report.inserted, 2);
  EXPECT_EQ(mapper.graph().reference(), second.id);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
  EXPECT_EQ(component_count(mapper.graph()), 1);
  EXPECT_LT(inner_error(mapper, simulation), 0.03);
}

}  // namespace
}  // namespace twofold
