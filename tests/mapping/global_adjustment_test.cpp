#include "mapping/global_adjustment.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "fixtures/graph_invariants.hpp"
#include "mapping/edges.hpp"
#include "tests/mapping/spiral_rounds.hpp"

namespace twofold {
namespace {

using simulation::map_next;
using simulation::Simulation;
using simulation::small_windows;
using simulation::spiral;

MapperOptions tiny_windows() {
  MapperOptions options = small_windows();
  options.inner_window = 6;
  options.outer_window = 12;
  return options;
}

/// A spiral that tiny windows have gone along, all poses in agreement.
class GlobalAdjustment : public ::testing::Test {
 protected:
  GlobalAdjustment() : simulation_(spiral(110, 11)), mapper_(simulation::thesis_rig(), tiny_windows()) {
    while (!simulation_.done()) map_next(simulation_, mapper_);
    mapper_.optimise_all_poses();
  }
  [[nodiscard]] double error(const GraphSnapshot& graph) const {
    return relative_error(graph, simulation_, [](KeyframeId, KeyframeId) { return true; }).rmse;
  }

  Simulation simulation_;
  Mapper mapper_;
};

TEST_F(GlobalAdjustment, TakesEveryMeasurementIntoAccountAtOnce) {
  GraphWriter writer(mapper_.publish());
  const GraphSnapshot& graph = writer.graph();
  const SE3 T_ref_w = graph.T_k_w(graph.reference());
  const double before = error(graph);
  const GlobalAdjustmentReport report =
      adjust_all_components(writer, simulation::thesis_rig(), tiny_windows());
  EXPECT_EQ(report.components, 1);
  EXPECT_EQ(report.keyframes, 110);
  EXPECT_GT(report.observations, 110 * 50);
  EXPECT_LT(report.final_cost, report.initial_cost);
  EXPECT_LT(error(graph), 0.8 * before);
  EXPECT_LT((graph.T_k_w(graph.reference()) * T_ref_w.inverse()).log().norm(), 1e-12);
  EXPECT_EQ(broken_invariant(graph, 2), "");
}

/// What was held before would pull keyframes back as soon as a window is entered there again.
TEST_F(GlobalAdjustment, EveryEdgeHoldsWhatWasAdjusted) {
  GraphWriter writer(mapper_.publish());
  adjust_all_components(writer, simulation::thesis_rig(), tiny_windows());
  const GraphSnapshot& graph = writer.graph();
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const Keyframe& from = graph.keyframe(KeyframeId{k});
    for (const Edge& edge : *from.edges) {
      ASSERT_TRUE(edge.marginalised);
      const SE3 T_other_this = graph.T_k_w(edge.other) * from.T_k_w.inverse();
      EXPECT_LT((relative_pose(graph, from.id, edge) * T_other_this.inverse()).log().norm(), 1e-9);
    }
  }
}

TEST_F(GlobalAdjustment, LeavesMapsThatAreTooLargeAsTheyAre) {
  MapperOptions options = tiny_windows();
  options.global.max_keyframes = 109;
  GraphWriter writer(mapper_.publish());
  const double before = error(writer.graph());
  const GlobalAdjustmentReport report = adjust_all_components(writer, simulation::thesis_rig(), options);
  EXPECT_EQ(report.too_large, 1);
  EXPECT_EQ(report.components, 0);
  EXPECT_EQ(error(writer.graph()), before);
}

TEST_F(GlobalAdjustment, OfARigComesAfterALoopOnly) {
  EXPECT_EQ(mapper_.adjust_all().components, 0);
  LoopConstraint loop;
  loop.from = KeyframeId{109};
  loop.to = KeyframeId{60};
  loop.weight = 40;
  loop.T_to_from = mapper_.graph().T_k_w(loop.to) * mapper_.graph().T_k_w(loop.from).inverse();
  mapper_.step({}, std::span(&loop, 1));
  mapper_.optimise_all_poses();
  EXPECT_EQ(mapper_.adjust_all().components, 1);
}

TEST(GlobalAdjustmentOfOneCamera, ComesAtTheEndOfEveryRun) {
  Simulation simulation = spiral(60, 5, 0, SensorKind::kMono);
  Mapper mapper(simulation::thesis_rig(SensorKind::kMono), tiny_windows());
  while (!simulation.done()) map_next(simulation, mapper);
  mapper.optimise_all_poses();
  const GlobalAdjustmentReport report = mapper.adjust_all();
  EXPECT_EQ(report.keyframes, 60);
  EXPECT_LT(report.final_cost, report.initial_cost);
  EXPECT_FALSE(report.focal_length) << "straight down all the way: a longer one is a higher spiral";
}

/// The spiral, the camera nodding.
Simulation nodding_spiral() {
  std::vector<SE3> path = simulation::spiral_path(60, 0.2, 0.8, 1.2);
  const std::vector<Vector3> points = simulation::scattered_points(path, 2, 25, 5);
  for (std::size_t k = 0; k < path.size(); ++k)
    path[k] = SE3(SO3::exp({0.4 * std::sin(0.15 * static_cast<double>(k)), 0, 0}), Vector3::Zero()) * path[k];
  simulation::Options options;
  options.rig = simulation::thesis_rig(SensorKind::kMono);
  options.seed = 5;
  options.max_observations = 120;
  return {options, points, path};
}

/// A map made with a focal length that is wrong by a twentieth: what it shows is the camera's own.
TEST(GlobalAdjustmentOfOneCamera, ShowsThatTheFocalLengthIsWrong) {
  Simulation simulation = nodding_spiral();
  Rig rig = simulation::thesis_rig(SensorKind::kMono);
  rig.camera.fx *= 1.05;
  rig.camera.fy *= 1.05;
  Mapper mapper(rig, tiny_windows());
  while (!simulation.done()) map_next(simulation, mapper);
  mapper.optimise_all_poses();
  const GlobalAdjustmentReport report = mapper.adjust_all();
  ASSERT_TRUE(report.focal_length);
  EXPECT_TRUE(report.focal_length->contradicts_rig());
  EXPECT_NEAR(1.05 * report.focal_length->scale, 1, 2 * report.focal_length->sigma);
}

TEST(GlobalAdjustmentWithOutliers, RemovesWhatDisagrees) {
  Simulation simulation = spiral(60, 3, 0.02);
  MapperOptions options = tiny_windows();
  options.outlier_chi2_mono = options.outlier_chi2_stereo = 1e9;  // the windows leave them all
  Mapper mapper(simulation::thesis_rig(), options);
  while (!simulation.done()) map_next(simulation, mapper);
  mapper.optimise_all_poses();
  GraphWriter writer(mapper.publish());
  const GlobalAdjustmentReport report =
      adjust_all_components(writer, simulation::thesis_rig(), tiny_windows());
  EXPECT_GT(report.outliers, 0.015 * report.observations);
  EXPECT_LT(report.outliers, 0.03 * report.observations);
  const auto all = [](KeyframeId, KeyframeId) { return true; };
  EXPECT_LT(relative_error(writer.graph(), simulation, all).rmse, 0.005);
  EXPECT_EQ(broken_invariant(writer.graph(), 2), "");
}

}  // namespace
}  // namespace twofold
