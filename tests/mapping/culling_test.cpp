#include "mapping/culling.hpp"

#include <gtest/gtest.h>

#include <set>

#include "fixtures/graph_invariants.hpp"
#include "fixtures/simulation.hpp"
#include "mapping/mapper.hpp"
#include "tests/mapping/small_graphs.hpp"

namespace twofold {
namespace {

KeyframeId k(std::uint32_t id) {
  return KeyframeId{id};
}

TEST(IsRedundant, NeedsEnoughPointsSeenByEnoughOthersAsFinely) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(5);
  CullingOptions options;
  for (int n = 0; n < 18; ++n) add_point(writer, rig, {0.2, 0.01 * n, 1}, {k(0), k(1), k(2), k(3)});
  for (int n = 0; n < 2; ++n) add_point(writer, rig, {0.2, 0.01 * n, 1.1}, {k(1), k(2)});
  EXPECT_TRUE(is_redundant(writer.graph(), k(1), options));  // 18 of 20
  EXPECT_TRUE(is_redundant(writer.graph(), k(3), options));  // 18 of 18
  add_point(writer, rig, {0.2, 0, 1.2}, {k(1), k(2), k(3)});
  EXPECT_FALSE(is_redundant(writer.graph(), k(1), options));  // 18 of 21
  Observation coarser = writer.graph().keyframe(k(0)).observations->front();
  coarser.level = 2;
  for (std::uint32_t p = 0; p < 18; ++p) {
    coarser.point = PointId{p};
    writer.add_observations(k(0), std::span(&coarser, 1));
  }
  EXPECT_FALSE(is_redundant(writer.graph(), k(3), options)) << "one of the others sees them less finely";
  EXPECT_TRUE(is_redundant(writer.graph(), k(0), options));
}

TEST(IsRedundant, NothingSaysSoOfAKeyframeWithoutPoints) {
  EXPECT_FALSE(is_redundant(chain(5).graph(), k(1), CullingOptions{}));
}

TEST(RemoveKeyframe, KeepsTheGraphConnectedAndRelativePosesKnown) {
  std::mt19937 rng(1);
  for (int trial = 0; trial < 20; ++trial) {
    GraphWriter writer = chain(30);
    for (int e = 0; e < 15; ++e) {
      const std::uint32_t a = rng() % 30, b = rng() % 30;
      if (a != b) link(writer, k(a), k(b), static_cast<int>(rng() % 40));
    }
    std::vector<Matrix4> before;
    for (std::uint32_t i = 0; i < 30; ++i) before.push_back(writer.graph().T_k_w(k(i)).matrix());
    for (int n = 0; n < 20; ++n) {
      const KeyframeId id = k(rng() % 29);  // 29 is the reference
      if (writer.graph().keyframe(id).culled()) continue;
      remove_keyframe(writer, id);
      ASSERT_EQ(broken_invariant(writer.graph()), "");
      ASSERT_EQ(component_count(writer.graph()), 1);
    }
    for (std::uint32_t i = 0; i < 30; ++i) {
      ASSERT_LT((writer.graph().T_k_w(k(i)).matrix() - before[i]).norm(), 1e-9);
    }
    for (std::uint32_t i = 0; i < 30; ++i) {
      for (const Edge& edge : *writer.graph().keyframe(k(i)).edges) {
        const SE3 T = writer.graph().T_k_w(edge.other) * writer.graph().T_k_w(k(i)).inverse();
        ASSERT_LT((relative_pose(writer.graph(), k(i), edge) * T.inverse()).log().norm(), 1e-9);
      }
    }
  }
}

/// Links in a row tell as little as all their errors together leave of them.
TEST(RemoveKeyframe, AnEdgeComposedOfTwoWeighsLessThanEither) {
  GraphWriter writer = chain(11, 0.1, 100);
  for (std::uint32_t n = 1; n < 10; ++n) remove_keyframe(writer, k(n));
  const Edge* edge = find_edge(writer.graph().keyframe(k(0)), k(10));
  ASSERT_NE(edge, nullptr);
  EXPECT_NEAR(edge->weight, 100 / 10, 1);

  GraphWriter weak = chain(3, 0.1, 1);
  remove_keyframe(weak, k(1));
  EXPECT_EQ(find_edge(weak.graph().keyframe(k(0)), k(2))->weight, 1);
}

/// After a loop, absolute poses in the windows and outside of them do not agree.
TEST(RemoveKeyframe, HangsOnAReplacementOutsideOfTheWindowsByTheirEdge) {
  GraphWriter writer = chain(4);
  const SE3 T_2_1 = SE3::exp((Vector6() << 0.1, -0.2, 0.05, 0.03, -0.02, 0.09).finished());
  link_marginalised(writer, k(1), k(2), 60, T_2_1);
  link_marginalised(writer, k(0), k(1), 30, SE3(SO3(), {-0.1, 0, 0}));
  remove_keyframe(writer, k(1));
  const SE3 T_1_2 = writer.graph().replacement(k(1)).T_this_replacement.unpacked();
  EXPECT_LT((T_1_2 * T_2_1).log().norm(), 1e-12);
  const Edge* composed = find_edge(writer.graph().keyframe(k(0)), k(2));
  ASSERT_NE(composed, nullptr);
  const SE3 T_1_0 = T_1_2 * composed->T_other_this;
  EXPECT_LT((T_1_0 * SE3(SO3(), {-0.1, 0, 0}).inverse()).log().norm(), 1e-12) << "pose and edge agree";
}

TEST(PointCuller, CullsWeakPointsThatAreInViewAndNeverSeenAgain) {
  const Rig rig = simulation::thesis_rig();
  CullingOptions options;
  options.max_misses = 3;
  PointCuller culler(rig, options);
  GraphWriter writer = chain(8, 0.02);
  const PointId forgotten = add_point(writer, rig, {0.05, 0, 1}, {k(0), k(1)});
  const PointId strong = add_point(writer, rig, {0.05, 0.1, 1}, {k(0), k(1), k(2)});
  const PointId outside = add_point(writer, rig, {-3, 0, 1}, {k(0), k(1)});
  const PointId again = add_point(writer, rig, {0.05, 0.2, 1}, {k(0), k(3)});
  const std::vector<PointId> points{forgotten, strong, outside, again};
  int culled = 0;
  for (const std::uint32_t newest : {2U, 3U, 4U, 5U}) culled += culler.cull(writer, k(newest), points);
  EXPECT_EQ(culled, 1);
  EXPECT_TRUE(writer.graph().point(forgotten).culled());
  for (const PointId id : {strong, outside, again}) EXPECT_FALSE(writer.graph().point(id).culled());
  culler.cull(writer, k(6), points);
  EXPECT_TRUE(writer.graph().point(again).culled()) << "three misses since it was last seen";
}

TEST(CullRedundantKeyframes, KeepsUpWithAMapperThatInsertsSeveralAtATime) {
  for (const std::size_t inserted : {0U, 1U, 3U}) {
    const Rig rig = simulation::thesis_rig();
    GraphWriter writer = chain(20);
    std::vector<KeyframeId> all;
    for (std::uint32_t i = 0; i < 20; ++i) all.push_back(k(i));
    for (int n = 0; n < 20; ++n) add_point(writer, rig, {0.2, 0.01 * n, 1}, all);
    DoubleWindow window;
    for (const KeyframeId id : all) window.nodes.push_back({.id = id});
    window.inner = window.nodes.size();
    const CullingOptions options;
    int points = 0;
    const std::vector<KeyframeId> culled =
        cull_redundant_keyframes(writer, window, options, inserted, points);
    EXPECT_EQ(culled.size(), 2 * std::max<std::size_t>(1, inserted));
    EXPECT_EQ(culled.front(), k(11)) << "newest first, but for the eight that are too new";
    EXPECT_EQ(points, 0);
  }
}

/// What the points have just said there is newer than an edge's constraint.
TEST(CullRedundantKeyframes, WithinTheWindowsPosesStayAsOptimised) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(20);
  link_marginalised(writer, k(11), k(12), 60, SE3(SO3(), {-0.3, 0, 0}));
  std::vector<KeyframeId> all;
  for (std::uint32_t i = 0; i < 20; ++i) all.push_back(k(i));
  for (int n = 0; n < 20; ++n) add_point(writer, rig, {0.2, 0.01 * n, 1}, all);
  DoubleWindow window;
  for (const KeyframeId id : all) {
    window.position.set(id, static_cast<int>(window.nodes.size()));
    window.nodes.push_back({.id = id});
  }
  window.inner = window.nodes.size();
  int points = 0;
  ASSERT_EQ(cull_redundant_keyframes(writer, window, {}, 1, points).front(), k(11));
  EXPECT_EQ(writer.graph().replacement(k(11)).id, k(12));
  EXPECT_NEAR(writer.graph().T_k_w(k(11)).translation().x(), -1.1, 1e-12);
}

/// The tracker's proposals hang on the reference.
TEST(CullRedundantKeyframes, TheReferenceStays) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(20);
  std::vector<KeyframeId> all;
  for (std::uint32_t i = 0; i < 20; ++i) all.push_back(k(i));
  for (int n = 0; n < 20; ++n) add_point(writer, rig, {0.2, 0.01 * n, 1}, all);
  writer.set_reference(k(11));
  DoubleWindow window;
  for (const KeyframeId id : all) window.nodes.push_back({.id = id});
  window.inner = window.nodes.size();
  int points = 0;
  EXPECT_EQ(cull_redundant_keyframes(writer, window, {}, 1, points), (std::vector{k(10), k(9)}));
}

TEST(RemoveKeyframe, PointsThatOneKeyframeAloneWouldSeeGoWithIt) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(4);
  const PointId one_left = add_point(writer, rig, {0.1, 0, 1}, {k(1), k(2)});
  const PointId two_left = add_point(writer, rig, {0.1, 0.1, 1}, {k(0), k(1), k(2)});
  EXPECT_EQ(remove_keyframe(writer, k(1)), 1);
  EXPECT_TRUE(writer.graph().point(one_left).culled());
  EXPECT_FALSE(writer.graph().point(two_left).culled());
}

TEST(RemoveOutlierObservations, APointIsHeldByItsAnchorAndAnotherKeyframe) {
  const Rig rig = simulation::thesis_rig();
  GraphWriter writer = chain(4);
  const PointId alone = add_point(writer, rig, {0.1, 0, 1}, {k(0), k(1)});
  const PointId adrift = add_point(writer, rig, {0.1, 0.1, 1}, {k(0), k(1), k(2)});
  const PointId held = add_point(writer, rig, {0.1, 0.2, 1}, {k(0), k(1), k(2)});
  const std::vector<WindowBuilder::Outlier> outliers{{k(0), adrift}, {k(1), alone}, {k(1), held}};
  EXPECT_EQ(remove_outlier_observations(writer, outliers), 2);
  EXPECT_TRUE(writer.graph().point(alone).culled()) << "seen from its anchor only";
  EXPECT_TRUE(writer.graph().point(adrift).culled()) << "its anchor does not see it";
  EXPECT_FALSE(writer.graph().point(held).culled());
}

/// A point is missed only by who should have seen it, and as its patch shows it.
class PointInViewTest : public testing::Test {
 protected:
  /// Whether a keyframe at T_k_w is said to have missed a point that two at the origin saw at x_w.
  [[nodiscard]] bool missed(const SE3& T_k_w, const Vector3& x_w) const {
    GraphWriter writer;
    for (const double x : {0.0, 0.02}) add_keyframe(writer, SE3(SO3(), {-x, 0, 0}));
    const KeyframeId newest = add_keyframe(writer, T_k_w);
    const std::vector<PointId> points{add_point(writer, rig_, x_w, {k(0), k(1)})};
    return PointCuller(rig_, options_).cull(writer, newest, points) == 1;
  }
  static SE3 at(const Vector3& place) { return {SO3(), -place}; }

  const Rig rig_ = simulation::thesis_rig();
  CullingOptions options_ = [] {
    CullingOptions options;
    options.max_misses = 1;
    return options;
  }();
};

TEST_F(PointInViewTest, WellInsideOfTheImage) {
  const Vector2 near_border(options_.view_border_px - 5, 200);
  const Vector3 x = 2 * rig_.camera.unproject(near_border);
  EXPECT_FALSE(missed(SE3(), x));
  EXPECT_TRUE(missed(SE3(), 2 * rig_.camera.unproject(near_border + Vector2(10, 0))));
}

TEST_F(PointInViewTest, FromAboutAsFar) {
  const Vector3 x(0, 0, 3);
  EXPECT_TRUE(missed(at({0, 0, 0.9}), x));
  EXPECT_FALSE(missed(at({0, 0, 1.1}), x)) << "1.6 times as near";
  EXPECT_TRUE(missed(at({0, 0, -1.4}), x));
  EXPECT_FALSE(missed(at({0, 0, -1.6}), x)) << "1.5 times as far";
}

TEST_F(PointInViewTest, FromAboutTheSameSide) {
  const Vector3 x(0, 0, 3);
  const auto from_aside = [&](double angle) {
    const Matrix3 R = SO3::exp({0, angle, 0}).matrix();
    const SE3 T_w_k(SO3::exp({0, angle, 0}), x - R * x);
    return missed(T_w_k.inverse(), x);
  };
  EXPECT_TRUE(from_aside(0.4));
  EXPECT_FALSE(from_aside(0.5)) << "the cosine is 0.88";
}

struct Size {
  std::size_t keyframes = 0, points = 0, observations = 0, edges = 0;
};

Size living(const GraphSnapshot& graph) {
  Size size;
  for (std::uint32_t i = 0; i < graph.keyframe_count(); ++i) {
    const Keyframe& keyframe = graph.keyframe(k(i));
    size.keyframes += keyframe.culled() ? 0 : 1;
    size.observations += keyframe.observations->size();
    size.edges += keyframe.edges->size();
  }
  for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
    size.points += graph.point(PointId{p}).culled() ? 0 : 1;
  }
  return size;
}

/// Browsing a mapped place: laps of the same circle, a tracker that starts new points where it has forgotten
/// old ones, metric loop closure. After the first laps the living map stays as large as it is.
TEST(Culling, BrowsingAMappedPlaceDoesNotGrowTheMap) {
  simulation::Options options;
  options.rig = simulation::thesis_rig();
  options.global_association = false;
  options.max_observations = 100;
  const int lap = 40, laps = 10;
  const std::vector<SE3> path = simulation::circle_path(lap * laps, laps, 0.8, 1.2);
  simulation::Simulation simulation(options, simulation::scattered_points(path, 2, 25, 1), path);
  MapperOptions mapping;
  mapping.inner_window = 15;
  mapping.outer_window = 40;
  mapping.culling.keep_replacements = 20;
  Mapper mapper(options.rig, mapping, simulation.search(10));
  std::vector<Size> after_lap;
  for (int n = 1; !simulation.done(); ++n) {
    KeyframeProposal* proposal = &simulation.propose(mapper.graph());
    mapper.step(std::span(&proposal, 1));
    ASSERT_EQ(broken_invariant(mapper.graph(), 2), "") << "keyframe " << n;
    ASSERT_EQ(component_count(mapper.graph()), 1);
    if (n % lap == 0) after_lap.push_back(living(mapper.graph()));
  }
  // Nothing remains of what was culled but what shares a chunk of 8 with something that stayed, replacements
  // of points' anchors, and for some time others.
  std::set<const void*> keyframes, points, replacements;
  for (std::uint32_t i = 0; i < mapper.graph().keyframe_count(); ++i) {
    keyframes.insert(&mapper.graph().keyframe(k(i)));
    replacements.insert(&mapper.graph().replacement(k(i)));
  }
  for (std::uint32_t p = 0; p < mapper.graph().point_count(); ++p)
    points.insert(&mapper.graph().point(PointId{p}));
  EXPECT_LE(keyframes.size(), 8 * (after_lap.back().keyframes + 1));
  EXPECT_LT(keyframes.size(), mapper.graph().keyframe_count() / 2);
  EXPECT_LE(points.size(), 8 * (after_lap.back().points + 1));
  EXPECT_LE(sizeof(Replacement), 64U);
  const std::size_t anchors = culled_anchors(mapper.graph());
  EXPECT_LE(anchors, after_lap.back().points);
  EXPECT_LE(known_replacements(mapper.graph()), 20 + 2 * anchors);
  EXPECT_LE(replacements.size(), 4 * (20 + 2 * anchors) + 1);
  EXPECT_LT(known_replacements(mapper.graph()), mapper.graph().keyframe_count() / 2);
  const Size& second = after_lap[2];
  const Size& last = after_lap.back();
  EXPECT_LE(last.keyframes, second.keyframes * 11 / 10);
  EXPECT_LE(last.points, second.points * 11 / 10);
  EXPECT_LE(last.observations, second.observations * 11 / 10);
  EXPECT_LE(last.edges, second.edges * 12 / 10);
  EXPECT_LT(last.keyframes, static_cast<std::size_t>(lap) * 2);
  for (const Size& s : after_lap) {
    RecordProperty("lap", std::to_string(s.keyframes) + " " + std::to_string(s.points) + " " +
                              std::to_string(s.observations) + " " + std::to_string(s.edges));
  }
}

}  // namespace
}  // namespace twofold
