// The mapper and the map as a whole: parts, loops, revisits, maps loaded, pose graph optimisation.
#include <gtest/gtest.h>

#include "fixtures/graph_invariants.hpp"
#include "mapping/mapper.hpp"
#include "tests/mapping/small_graphs.hpp"
#include "tests/mapping/spiral_rounds.hpp"

namespace twofold {
namespace {

using simulation::inner_error;
using simulation::map_next;
using simulation::Simulation;
using simulation::small_windows;
using simulation::spiral;

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
  loop.weight = 40;
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
  mapper.continue_from(writer.publish());
  EXPECT_EQ(mapper.step({}, std::span(&loop, 1)).loops, 1) << "its replacement takes it";
  for (const PointId point : points) writer.cull_point(point);
  writer.forget_replacements(0);
  ASSERT_FALSE(writer.graph().live_replacement(loop.to));
  mapper.continue_from(writer.publish());
  const MapperReport report = mapper.step({}, std::span(&loop, 1));
  EXPECT_EQ(report.loops, 0);
  EXPECT_EQ(report.late_loops, 1);
  EXPECT_EQ(mapper.graph().reference(), loop.from);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
}

/// E.g. of a replay over other frames, or of a proposal that never arrived.
TEST(Mapper, ALoopOfAKeyframeThatTheMapNeverHadIsDroppedAndCounted) {
  Simulation simulation = spiral(30, 9);
  Mapper mapper(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 3; ++k) map_next(simulation, mapper);
  LoopConstraint loop;
  loop.from = KeyframeId{0};
  loop.to = KeyframeId{3};
  const MapperReport report = mapper.step({}, std::span(&loop, 1));
  EXPECT_EQ(report.loops, 0);
  EXPECT_EQ(report.late_loops, 1);
}

TEST(Mapper, TheWindowFormsAroundTheReference) {
  Simulation simulation = spiral(90, 10);
  MapperOptions options = small_windows();
  options.inner_window = 5;
  options.outer_window = 10;
  Mapper mapper(simulation::thesis_rig(), options);
  while (!simulation.done()) map_next(simulation, mapper);
  ASSERT_FALSE(mapper.window().contains(KeyframeId{10}));
  GraphWriter writer(mapper.publish());
  writer.set_reference(KeyframeId{10});
  mapper.continue_from(writer.publish());
  const MapperReport report = mapper.step({});
  EXPECT_EQ(mapper.graph().reference(), KeyframeId{10});
  EXPECT_EQ(mapper.window().nodes[0].id, KeyframeId{10});
  EXPECT_EQ(report.poses_set, report.inner_window + report.outer_window - 1);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
  EXPECT_LT(inner_error(mapper, simulation), 0.03);
}

TEST(Mapper, ContinuesFromAnotherGraph) {
  Simulation simulation = spiral(40, 12);
  Mapper first(simulation::thesis_rig(), small_windows());
  for (int k = 0; k < 25; ++k) map_next(simulation, first);
  const GraphSnapshot saved = first.publish();
  Mapper second(simulation::thesis_rig(), small_windows());
  second.continue_from(saved);
  EXPECT_EQ(second.graph().version(), saved.version() + 1);
  while (!simulation.done()) map_next(simulation, second);
  EXPECT_EQ(second.graph().keyframe_count(), 40U);
  EXPECT_EQ(saved.keyframe_count(), 25U);
  EXPECT_EQ(broken_invariant(saved, 2), "");
  EXPECT_EQ(broken_invariant(second.graph(), 2), "");
  EXPECT_EQ(component_count(second.graph()), 1);
  EXPECT_LT(inner_error(second, simulation), 0.03);
}

SE3 relative(const GraphSnapshot& graph, KeyframeId from, KeyframeId to) {
  return graph.T_k_w(to) * graph.T_k_w(from).inverse();
}

/// A row of keyframes, saved while the last of them were in W1. The next session begins elsewhere, walks
/// beside the row with a drift of 2 % of the way, and meets one of those last.
class SecondSession {
 public:
  SecondSession() : mapper_(simulation::thesis_rig(), {}) {
    GraphWriter writer = chain(kSaved, kStep, kWeight);
    for (std::uint32_t k = 0; k < kFirstInner; ++k) {
      const KeyframeId from{k}, to{k + 1};
      link_marginalised(writer, from, to, kWeight, relative(writer.graph(), from, to));
    }
    for (std::uint32_t k = kFirstInner; k + 1 < kSaved; ++k) {
      for (int n = 0; n < kWeight; ++n)
        add_point(writer, simulation::thesis_rig(),
                  {kStep * (k + 0.5), 0.02 * (n - kWeight / 2), 2 + 0.01 * (n % 7)},
                  {KeyframeId{k}, KeyframeId{k + 1}});
    }
    mapper_.continue_from(writer.publish());
    KeyframeId newest{kStart};
    for (std::uint32_t k = kSaved; k < kSaved + kEnd - kStart; ++k) newest = walk(KeyframeId{k}, newest);
    LoopConstraint loop;
    loop.from = KeyframeId{kEnd};
    loop.to = newest;
    loop.weight = kWeight;
    mapper_.step({}, std::span(&loop, 1));
    mapper_.optimise_all_poses();
  }

  [[nodiscard]] const GraphSnapshot& graph() const { return mapper_.graph(); }
  /// That a link between two keyframes of the row has on average [m].
  [[nodiscard]] double error_of_a_link(std::uint32_t from, std::uint32_t to) const {
    return relative(graph(), KeyframeId{from}, KeyframeId{to}).translation().x() / (to - from) + kStep;
  }

  static constexpr std::uint32_t kSaved = 120, kFirstInner = 95, kStart = 20, kEnd = 108;

 private:
  /// As a pose that was measured as a whole, so that it counts like the row's links.
  KeyframeId walk(KeyframeId id, KeyframeId reference) {
    KeyframeProposal proposal;
    proposal.id = id;
    proposal.reference = reference;
    proposal.median_depth = 1;
    proposal.T_k_ref = SE3(SO3(), {-1.02 * kStep, 0, 0});
    Keyframe one_metre_deep;
    one_metre_deep.median_depth = 1;
    Edge edge;
    edge.weight = kWeight;
    proposal.pose_information = 1.01 * edge_information(one_metre_deep, one_metre_deep, edge,
                                                        simulation::thesis_rig(), mapper_.options().edge);
    KeyframeProposal* only = &proposal;
    mapper_.step(std::span(&only, 1));
    return id;
  }

  static constexpr int kWeight = 30;
  static constexpr double kStep = 0.5;
  Mapper mapper_;
};

TEST(Mapper, ALoopOfALaterSessionIsSpreadOverAllThatWasSaved) {
  const SecondSession session;
  const GraphSnapshot& graph = session.graph();
  for (std::uint32_t k = 0; k + 1 < SecondSession::kSaved; ++k)
    EXPECT_TRUE(find_edge(graph.keyframe(KeyframeId{k}), KeyframeId{k + 1})->marginalised) << k;
  const double before = session.error_of_a_link(SecondSession::kStart, SecondSession::kFirstInner);
  const double in_last_window = session.error_of_a_link(SecondSession::kFirstInner, SecondSession::kEnd);
  EXPECT_LT(before, -0.004) << "about half of the drift of 0.88 m is the row's";
  EXPECT_NEAR(in_last_window, before, 0.1 * std::abs(before));
}

TEST(Mapper, RelaxingTheWholeMapKeepsTheReferenceAndTheAccuracy) {
  Simulation simulation = spiral(110, 11);
  MapperOptions options = small_windows();
  options.inner_window = 6;
  options.outer_window = 12;
  Mapper mapper(simulation::thesis_rig(), options);
  while (!simulation.done()) map_next(simulation, mapper);
  const SE3 T_ref_w = mapper.graph().T_k_w(mapper.graph().reference());
  const PoseGraphReport report = mapper.optimise_all_poses();
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.keyframes, 110);
  EXPECT_LE(report.final_cost, report.initial_cost);
  EXPECT_LT((mapper.graph().T_k_w(mapper.graph().reference()) * T_ref_w.inverse()).log().norm(), 1e-9);
  const auto all = [](KeyframeId, KeyframeId) { return true; };
  EXPECT_LT(simulation::relative_error(mapper.graph(), simulation, all).rmse, 0.015);
  EXPECT_EQ(broken_invariant(mapper.graph(), 2), "");
}

}  // namespace
}  // namespace twofold
