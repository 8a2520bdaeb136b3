// The mapper and the map as a whole: parts, loops, revisits, maps loaded, pose graph optimisation.
#include <gtest/gtest.h>

#include "fixtures/graph_invariants.hpp"
#include "mapping/mapper.hpp"
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
