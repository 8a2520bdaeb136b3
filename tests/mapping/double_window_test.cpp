#include "mapping/double_window.hpp"

#include <gtest/gtest.h>

#include <numbers>

#include "fixtures/graph_invariants.hpp"
#include "fixtures/simulation.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

MapperOptions windows(int inner, int outer) {
  MapperOptions options;
  options.inner_window = inner;
  options.outer_window = outer;
  return options;
}

DoubleWindow select(const GraphSnapshot& graph, const MapperOptions& options) {
  DoubleWindow window;
  SelectionScratch scratch;
  select_double_window(graph, options, scratch, window);
  return window;
}

double edge_residual(const GraphSnapshot& graph, KeyframeId from, const Edge& edge) {
  const SE3 T_to_from = graph.T_k_w(edge.other) * graph.T_k_w(from).inverse();
  return (edge.T_other_this * T_to_from.inverse()).log().norm();
}

TEST(SelectDoubleWindow, InnerThenOuterAroundTheReference) {
  GraphWriter writer = chain(40);
  writer.set_reference(KeyframeId{20});
  const DoubleWindow window = select(writer.graph(), windows(5, 10));
  ASSERT_EQ(window.nodes.size(), 15U);
  EXPECT_EQ(window.inner, 5U);
  for (std::uint32_t k = 18; k <= 22; ++k) EXPECT_TRUE(window.is_inner(KeyframeId{k})) << k;
  for (const std::uint32_t k : {13U, 17U, 23U, 27U}) {
    EXPECT_TRUE(window.contains(KeyframeId{k})) << k;
    EXPECT_FALSE(window.is_inner(KeyframeId{k})) << k;
  }
  EXPECT_FALSE(window.contains(KeyframeId{12}));
  EXPECT_EQ(select(writer.graph(), windows(5, 1000)).nodes.size(), 40U);
}

TEST(SelectDoubleWindow, AnchorsJoinOnlyWithAnEdgeToTheInnerWindow) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(12);
  // Seen from the reference; anchored near, one edge away from W1 but outside of both windows, and far.
  add_point(writer, rig, {-0.8, 0, 1.2}, {KeyframeId{5}, KeyframeId{11}});
  add_point(writer, rig, {-0.8, 0, 1.2}, {KeyframeId{0}, KeyframeId{11}});
  const DoubleWindow before = select(writer.graph(), windows(2, 0));
  EXPECT_EQ(before.nodes.size(), 2U);
  link(writer, KeyframeId{5}, KeyframeId{10}, 1);
  const DoubleWindow window = select(writer.graph(), windows(2, 1));  // W1 = {11, 10}, 9 leaves W2
  ASSERT_EQ(window.nodes.size(), 3U);
  EXPECT_EQ(window.nodes[2].id, KeyframeId{5});
  EXPECT_EQ(window.nodes[static_cast<std::size_t>(window.nodes[2].parent)].id, KeyframeId{10});
  EXPECT_FALSE(window.is_inner(KeyframeId{5}));
  EXPECT_FALSE(window.contains(KeyframeId{0}));
  MapperOptions none = windows(2, 1);
  none.max_anchors = 0;
  EXPECT_EQ(select(writer.graph(), none).nodes.back().id, KeyframeId{9});
}

TEST(SelectDoubleWindow, KeepsItsSizeWhateverAnchorsJoin) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(20);
  for (const std::uint32_t anchor : {2U, 3U, 4U, 16U}) {
    add_point(writer, rig, {-0.8, 0, 1.2}, {KeyframeId{anchor}, KeyframeId{19}});
    if (anchor < 16) link(writer, KeyframeId{anchor}, KeyframeId{18}, 1);
  }
  // By breadth-first search alone W2 is {17, 2, ...}: all three old keyframes are neighbours of 18.
  MapperOptions options = windows(2, 8);
  for (int outer = 0; outer <= 8; ++outer) {
    options.outer_window = outer;
    const DoubleWindow window = select(writer.graph(), options);
    EXPECT_EQ(window.nodes.size(), 2U + static_cast<std::size_t>(outer));
    EXPECT_EQ(window.inner, 2U);
    for (std::size_t n = 0; n < window.nodes.size(); ++n) {
      EXPECT_EQ(window.position.find(window.nodes[n].id), static_cast<int>(n));
      if (n == 0) continue;
      ASSERT_GE(window.nodes[n].parent, 0);
      ASSERT_LT(window.nodes[n].parent, static_cast<int>(n));
      const KeyframeId parent = window.nodes[static_cast<std::size_t>(window.nodes[n].parent)].id;
      EXPECT_NE(find_edge(writer.graph().keyframe(parent), window.nodes[n].id), nullptr);
    }
    if (outer < 3) continue;
    for (const std::uint32_t anchor : {2U, 3U, 4U}) EXPECT_TRUE(window.contains(KeyframeId{anchor}));
  }
}

/// Eq. 6.3 and the caveat after it: a ring whose relative poses do not add up breaks far from the reference.
TEST(EnterWindow, ALoopThatDoesNotAddUpBreaksAtTheRim) {
  constexpr std::uint32_t kCount = 40;
  GraphWriter writer;
  const std::vector<SE3> truth = simulation::circle_path(kCount, 1, 3, 1);
  for (const SE3& T_k_w : truth) add_keyframe(writer, T_k_w);
  std::mt19937 rng(2);
  std::normal_distribution<double> noise(0, 0.01);
  for (std::uint32_t k = 0; k < kCount; ++k) {
    const std::uint32_t next = (k + 1) % kCount;
    Vector6 error;
    for (int i = 0; i < 6; ++i) error[i] = noise(rng);
    link_marginalised(writer, KeyframeId{k}, KeyframeId{next}, 30,
                      SE3::exp(error) * truth[next] * truth[k].inverse());
  }
  const KeyframeId reference{10};
  writer.set_reference(reference);
  const DoubleWindow window = select(writer.graph(), windows(9, 100));
  IdMap consistent;
  consistent.set(reference, 0);
  EXPECT_EQ(enter_window(writer, consistent, window), static_cast<int>(kCount) - 1);
  int broken = 0;
  for (std::uint32_t k = 0; k < kCount; ++k) {
    for (const Edge& edge : *writer.graph().keyframe(KeyframeId{k}).edges) {
      if (edge.other < KeyframeId{k} || edge_residual(writer.graph(), KeyframeId{k}, edge) < 1e-9) continue;
      ++broken;
      // Opposite of the reference: the last two the breadth-first search reaches.
      EXPECT_GE(window.position.find(KeyframeId{k}), static_cast<int>(kCount) - 2);
      EXPECT_GE(window.position.find(edge.other), static_cast<int>(kCount) - 2);
    }
  }
  EXPECT_EQ(broken, 1);
}

TEST(EnterWindow, SetsWhoEntersAndItsChildrenAndNobodyElse) {
  GraphWriter writer = chain(9);
  for (std::uint32_t k = 1; k < 9; ++k) {  // relative poses say twice the distance
    link_marginalised(writer, KeyframeId{k - 1}, KeyframeId{k}, 30, SE3(SO3(), {-0.2, 0, 0}));
  }
  const DoubleWindow window = select(writer.graph(), windows(3, 10));
  IdMap consistent;
  for (const std::uint32_t k : {8U, 7U, 6U, 4U, 3U}) consistent.set(KeyframeId{k}, 0);  // 5 enters
  EXPECT_EQ(enter_window(writer, consistent, window), 6);
  for (std::uint32_t k = 6; k < 9; ++k) {
    EXPECT_NEAR(writer.graph().T_k_w(KeyframeId{k}).translation().x(), -0.1 * k, 1e-12);
  }
  for (std::uint32_t k = 0; k < 6; ++k) {
    EXPECT_NEAR(writer.graph().T_k_w(KeyframeId{k}).translation().x(), -0.6 + 0.2 * (6 - k), 1e-12);
  }
}

/// Unmarginalised edges are made of the absolute poses, which change while poses are set.
TEST(EnterWindow, ReadsRelativePosesBeforeItChangesAbsoluteOnes) {
  GraphWriter writer = chain(5);
  link_marginalised(writer, KeyframeId{3}, KeyframeId{4}, 30, SE3(SO3(), {-5, 0, 0}));
  const DoubleWindow window = select(writer.graph(), windows(2, 10));
  IdMap consistent;
  consistent.set(KeyframeId{4}, 0);
  enter_window(writer, consistent, window);
  for (std::uint32_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(writer.graph().T_k_w(KeyframeId{k}).translation().x(), 4.6 + 0.1 * (3 - k), 1e-9);
  }
}

TEST(MarginaliseLeftEdges, RecomputesWhatLeftTheInnerWindowAndOnlyThat) {
  GraphWriter writer = chain(12);
  const DoubleWindow before = select(writer.graph(), windows(4, 3));  // W1 = 11..8, W2 = 7..5
  // An old constraint within W1: its poses have been optimised since.
  link_marginalised(writer, KeyframeId{8}, KeyframeId{9}, 30, SE3(SO3(), {1, 1, 1}));
  link_marginalised(writer, KeyframeId{5}, KeyframeId{6}, 30, SE3(SO3(), {2, 2, 2}));
  add_keyframe(writer, SE3(SO3(), {-1.2, 0, 0}));
  link(writer, KeyframeId{11}, KeyframeId{12}, 30);
  writer.set_reference(KeyframeId{12});
  const DoubleWindow now = select(writer.graph(), windows(4, 3));  // W1 = 12..9, W2 = 8..6
  marginalise_left_edges(writer, before, now);
  const GraphSnapshot& graph = writer.graph();
  const Edge* left = find_edge(graph.keyframe(KeyframeId{8}), KeyframeId{9});
  EXPECT_TRUE(left->marginalised);
  EXPECT_LT((left->T_other_this.translation() - Vector3(-0.1, 0, 0)).norm(), 1e-12);
  EXPECT_TRUE(find_edge(graph.keyframe(KeyframeId{7}), KeyframeId{8})->marginalised);
  EXPECT_FALSE(find_edge(graph.keyframe(KeyframeId{9}), KeyframeId{10})->marginalised);
  EXPECT_FALSE(find_edge(graph.keyframe(KeyframeId{11}), KeyframeId{12})->marginalised);
  const Edge* outside = find_edge(graph.keyframe(KeyframeId{5}), KeyframeId{6});
  EXPECT_EQ(outside->T_other_this.translation(), Vector3(2, 2, 2));
  EXPECT_EQ(broken_invariant(graph), "");
}

TEST(EdgeInformation, FollowsEquation62) {
  Rig rig = simulation::thesis_rig();
  rig.noise.sigma_px = 0.5;
  Keyframe a, b;
  a.median_depth = 2;
  b.median_depth = 4;
  Edge edge;
  edge.weight = 50;
  EdgeInformationOptions options;
  options.rot_share = 0.2;
  options.trans_share = 0.1;
  const Matrix6 information = edge_information(a, b, edge, rig, options);
  const double ideal = 300 / (std::numbers::sqrt2 * 0.5);
  EXPECT_NEAR(information(0, 0), 50 * std::pow(0.1 * ideal / 3, 2), 1e-9);
  EXPECT_NEAR(information(5, 5), 50 * std::pow(0.2 * ideal, 2), 1e-9);
  EXPECT_EQ(information(0, 5), 0);
  edge.weight = 100;
  EXPECT_LT((edge_information(a, b, edge, rig, options) - 2 * information).norm(), 1e-9);
}

TEST(SharedPoints, CountedFromBothSides) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(4);
  for (int n = 0; n < 7; ++n) add_point(writer, rig, {-0.1, 0.01 * n, 1}, {KeyframeId{0}, KeyframeId{2}});
  for (int n = 0; n < 3; ++n) {
    add_point(writer, rig, {-0.1, 0.01 * n, 1}, {KeyframeId{1}, KeyframeId{2}, KeyframeId{3}});
  }
  IdMap counts;
  std::vector<Covisible> covisible;
  covisible_keyframes(writer.graph(), KeyframeId{2}, counts, covisible);
  ASSERT_EQ(covisible.size(), 3U);
  for (const auto& [id, points] : covisible) {
    EXPECT_EQ(points, id == KeyframeId{0} ? 7 : 3);
    EXPECT_EQ(points, shared_points(writer.graph().keyframe(KeyframeId{2}), writer.graph().keyframe(id)));
  }
}

}  // namespace
}  // namespace twofold
