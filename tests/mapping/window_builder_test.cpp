#include "mapping/window_builder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "estimation/window_solver.hpp"
#include "fixtures/graph_invariants.hpp"
#include "fixtures/simulation.hpp"
#include "mapping/culling.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

class WindowBuilderTest : public testing::Test {
 protected:
  WindowBuilderTest() : rig_(simulation::thesis_rig()), writer_(chain(10)) {
    options_.inner_window = 3;  // W1 = 9, 8, 7
    options_.outer_window = 3;  // W2 = 6, 5, 4
    options_.max_anchors = 0;
  }

  static KeyframeId k(std::uint32_t id) { return KeyframeId{id}; }
  PointId point(const std::vector<KeyframeId>& observers) {
    y_ += 0.02;
    return add_point(writer_, rig_, {0.6, y_, 1.5}, observers);
  }
  WindowBuilder build() {
    SelectionScratch scratch;
    select_double_window(writer_.graph(), options_, scratch, window_);
    WindowBuilder builder(rig_, options_);
    builder.build(writer_.graph(), window_);
    EXPECT_EQ(invalid_reason(builder.problem()), "");
    return builder;
  }

  Rig rig_;
  MapperOptions options_;
  GraphWriter writer_;
  DoubleWindow window_;
  double y_ = -0.3;
};

TEST_F(WindowBuilderTest, TakesPointsOfTheInnerWindowWithAllTheirMeasurementsInBothWindows) {
  const PointId inner = point({k(7), k(8), k(9)});
  const PointId both = point({k(6), k(4), k(7), k(0)});  // anchor 6 has an edge to 7
  point({k(4), k(7), k(8)});                             // its anchor is in W2 without an edge to W1
  point({k(4), k(5), k(6)});                             // not seen from W1
  point({k(0), k(8), k(9)});                             // its anchor is outside
  point({k(8), k(1)});                                   // measured once in the windows
  const WindowBuilder builder = build();
  ASSERT_EQ(builder.point_ids().size(), 2U);
  for (std::size_t p = 0; p < 2; ++p) {
    const auto& point = builder.problem().points[p];
    const PointId id = builder.point_ids()[p];
    ASSERT_TRUE(id == inner || id == both);
    EXPECT_EQ(point.observation_count, 3);
    std::set<KeyframeId> seen_from;
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& o = builder.problem().observations[static_cast<std::size_t>(point.first_observation + n)];
      seen_from.insert(window_.nodes[static_cast<std::size_t>(o.pose)].id);
      EXPECT_LT(observation_chi2(builder.problem(), position_w(builder.problem(), point), o), 1e-6);
    }
    const std::set<KeyframeId> expected =
        id == inner ? std::set{k(7), k(8), k(9)} : std::set{k(4), k(6), k(7)};
    EXPECT_EQ(seen_from, expected);
  }
}

TEST_F(WindowBuilderTest, ConstrainsAllEdgesWithAnEndInTheOuterWindow) {
  link_marginalised(writer_, k(9), k(5), 20, SE3(SO3(), {0.3, 0.2, 0.1}));
  link(writer_, k(9), k(7), 20);
  link(writer_, k(4), k(3), 20);
  const WindowBuilder builder = build();
  std::set<std::pair<KeyframeId, KeyframeId>> joined;
  for (const auto& c : builder.problem().constraints) {
    const KeyframeId i = window_.nodes[static_cast<std::size_t>(c.i)].id;
    const KeyframeId j = window_.nodes[static_cast<std::size_t>(c.j)].id;
    EXPECT_TRUE(joined.insert(std::minmax(i, j)).second) << "twice";
    const SE3 expected = relative_pose(writer_.graph(), i, *find_edge(writer_.graph().keyframe(i), j));
    EXPECT_LT((expected * c.T_j_i.inverse()).log().norm(), 1e-12);
  }
  // From W1 = {9, 8, 5} (5 is next to 9 now by breadth-first order) nothing within W1 may be constrained,
  // save a recognised loop whose sides share no points yet.
  for (const auto& [i, j] : joined) {
    const Edge& edge = *find_edge(writer_.graph().keyframe(i), j);
    EXPECT_TRUE(!(window_.is_inner(i) && window_.is_inner(j)) || edge.marginalised);
  }
  std::size_t expected = 0;
  for (const TreeNode& node : window_.nodes) {
    for (const Edge& edge : *writer_.graph().keyframe(node.id).edges) {
      if (edge.other < node.id || !window_.contains(edge.other)) continue;
      const bool within = window_.is_inner(node.id) && window_.is_inner(edge.other);
      expected += !within || edge.marginalised ? 1 : 0;
    }
  }
  EXPECT_EQ(joined.size(), expected);
}

TEST_F(WindowBuilderTest, KeepsTheBestMeasuredPointsWithinTheBudget) {
  options_.max_points = 5;
  std::set<PointId> best;
  for (int n = 0; n < 4; ++n) {
    point({k(7), k(8)});
    best.insert(point({k(7), k(8), k(9)}));
  }
  const WindowBuilder builder = build();
  ASSERT_EQ(builder.point_ids().size(), 5U);
  int kept = 0, observations = 0;
  for (std::size_t p = 0; p < 5; ++p) {
    kept += best.contains(builder.point_ids()[p]) ? 1 : 0;
    EXPECT_EQ(builder.problem().points[p].first_observation, observations);
    observations += builder.problem().points[p].observation_count;
  }
  EXPECT_EQ(kept, 4);
  EXPECT_EQ(builder.problem().observations.size(), static_cast<std::size_t>(observations));
}

TEST_F(WindowBuilderTest, PointsWhoseAnchorWasCulledAreOptimisedAndGoBackIntoTheirAnchorsFrame) {
  const PointId id = point({k(7), k(8), k(9)});
  const Vector3 x_w = writer_.graph().position(id);
  link(writer_, k(6), k(8), 20);
  remove_keyframe(writer_, k(7));
  EXPECT_EQ(broken_invariant(writer_.graph(), 2), "");
  WindowBuilder builder = build();
  ASSERT_EQ(builder.point_ids(), std::vector{id});
  EXPECT_EQ(window_.nodes[static_cast<std::size_t>(builder.problem().points[0].anchor)].id, k(9));
  const WindowProblem& problem = builder.problem();
  EXPECT_LT(observation_chi2(problem, position_w(problem, problem.points[0]), problem.observations[0]), 1e-6);
  for (auto& pose : builder.problem().poses) pose.T_k_w = pose.T_k_w * SE3(SO3(), {3, 2, 1});
  builder.write_back(writer_, window_);
  EXPECT_EQ(writer_.graph().point(id).anchor, k(7));
  EXPECT_LT((writer_.graph().position(id) - (x_w - Vector3(3, 2, 1))).norm(), 1e-9);
}

TEST_F(WindowBuilderTest, PointsWhoseAnchorWasCulledDoNotComeTooNearEither) {
  const PointId id = point({k(7), k(8), k(9)});
  const Vector3 x_w = writer_.graph().position(id);
  link(writer_, k(6), k(8), 20);
  remove_keyframe(writer_, k(7));
  WindowBuilder builder = build();
  ASSERT_EQ(builder.point_ids(), std::vector{id});
  const double median_depth = writer_.graph().keyframe(k(9)).median_depth;
  ASSERT_GT(median_depth, 0);
  builder.problem().points[0].psi.z() = 1.01 / (options_.nearest * median_depth);
  builder.write_back(writer_, window_);
  EXPECT_LT((writer_.graph().position(id) - x_w).norm(), 1e-12);
}

TEST_F(WindowBuilderTest, MeasurementsBehindTheirCameraStayOutOfTheRound) {
  const PointId id = point({k(7), k(8), k(9)});
  writer_.set_pose(k(9), SE3(SO3::exp({0, 3.1, 0}), {0, 0, 0}));  // looks the other way
  WindowBuilder builder = build();
  ASSERT_EQ(builder.point_ids(), std::vector{id});
  EXPECT_EQ(builder.problem().points[0].observation_count, 2);
  WindowSolver solver;
  const SolverSummary summary = solver.solve(builder.problem(), {});
  EXPECT_LE(summary.final_cost, summary.initial_cost);
}

TEST_F(WindowBuilderTest, WrongMeasurementsAreFoundAndBadPointsCulled) {
  const PointId good = point({k(7), k(8), k(9)});
  const PointId pair = point({k(8), k(9)});
  const PointId anchor = point({k(7), k(8), k(9)});
  for (const auto& [keyframe, id] : {std::pair(k(9), good), std::pair(k(9), pair), std::pair(k(7), anchor)}) {
    Observation wrong = *find_observation(writer_.graph().keyframe(keyframe), id);
    wrong.pixel += Eigen::Vector3f(20, 0, 20);
    writer_.add_observations(keyframe, std::span(&wrong, 1));
  }
  const WindowBuilder builder = build();
  std::vector<WindowBuilder::Outlier> outliers;
  builder.find_outliers(window_, outliers);
  ASSERT_EQ(outliers.size(), 3U);
  EXPECT_TRUE(std::is_sorted(outliers.begin(), outliers.end()));
  EXPECT_EQ(remove_outlier_observations(writer_, outliers), 2);
  EXPECT_FALSE(writer_.graph().point(good).culled());
  EXPECT_TRUE(writer_.graph().point(pair).culled());
  EXPECT_TRUE(writer_.graph().point(anchor).culled());
  EXPECT_EQ(broken_invariant(writer_.graph(), 2), "");
}

TEST_F(WindowBuilderTest, OneCameraJudgesTheMeasurementsOfARigsMapByTheirTwoComponents) {
  const PointId right_off = point({k(7), k(8), k(9)});
  const PointId between = point({k(7), k(8), k(9)});
  Observation wrong = *find_observation(writer_.graph().keyframe(k(9)), right_off);
  wrong.pixel.z() += 20;
  writer_.add_observations(k(9), std::span(&wrong, 1));
  wrong = *find_observation(writer_.graph().keyframe(k(9)), between);
  const float chi2 = 11.6F;  // too much for two components, not for three
  wrong.pixel.y() += std::sqrt(chi2 / rig_.information(wrong.pixel, 0).y());
  writer_.add_observations(k(9), std::span(&wrong, 1));
  std::vector<WindowBuilder::Outlier> outliers;
  const auto points = [&] {
    build().find_outliers(window_, outliers);
    std::vector<PointId> ids;
    for (const WindowBuilder::Outlier& outlier : outliers) ids.push_back(outlier.point);
    return ids;
  };
  EXPECT_EQ(points(), std::vector{right_off});
  rig_.kind = SensorKind::kMono;
  EXPECT_EQ(points(), std::vector{between});
}

}  // namespace
}  // namespace twofold
