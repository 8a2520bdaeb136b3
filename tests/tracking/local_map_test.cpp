// Which points the tracker looks for.
#include "tracking/common/local_map.hpp"

#include <gtest/gtest.h>

#include <set>

#include "geometry/inverse_depth.hpp"
#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// Four keyframes along a line, each joined to the next, the later ones more strongly.
class LocalMapTest : public ::testing::Test {
 protected:
  static constexpr KeyframeId kPart{0};
  static constexpr int kNeighbours = 20;
  static KeyframeId k(std::uint32_t id) { return KeyframeId{id}; }

  LocalMapTest() {
    for (std::uint32_t n = 0; n < 4; ++n) add_keyframe(kPart);
    for (std::uint32_t n = 0; n < 3; ++n) join(k(n), k(n + 1), 20 + static_cast<int>(n));
  }

  KeyframeId add_keyframe(KeyframeId part) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer_.graph().keyframe_count())};
    keyframe.part = part;
    keyframe.T_k_w =
        SE3(SO3::exp({0, 0.1 * index(keyframe.id), 0}), Vector3(-0.5 * index(keyframe.id), 0, 0));
    writer_.add_keyframe(keyframe);
    return keyframe.id;
  }
  void join(KeyframeId a, KeyframeId b, int weight) {
    Edge edge;
    edge.other = b;
    edge.weight = weight;
    writer_.set_edge(a, edge);
  }
  /// Seen first, and anchored, in the first of the observers.
  PointId add_point(const std::vector<KeyframeId>& observers) {
    const PointId id{static_cast<std::uint32_t>(writer_.graph().point_count())};
    MapPoint point;
    point.anchor = observers.front();
    point.psi = {0.01 * index(id), 0.02, 0.25};
    point.appearance = std::make_shared<const PointAppearance>();
    writer_.add_point(id, point);
    Observation observation;
    observation.point = id;
    for (const KeyframeId observer : observers)
      writer_.add_observations(observer, std::span(&observation, 1));
    return id;
  }
  static ImmaturePoint immature_point(KeyframeId anchor) {
    ImmaturePoint point;
    point.anchor = anchor;
    point.psi = {-0.1, 0.1, 0.5};
    return point;
  }
  std::size_t update(KeyframeId reference, int max_neighbours = kNeighbours) {
    local_map_.update(graph_, reference, immature_, max_neighbours);
    return local_map_.points().size();
  }
  void publish() { graph_ = writer_.publish(); }
  [[nodiscard]] std::multiset<PointId> ids() const {
    std::multiset<PointId> ids;
    for (const TrackedPoint& point : local_map_.points()) ids.insert(point.id);
    return ids;
  }

  GraphWriter writer_;
  GraphSnapshot graph_;
  ImmaturePoints immature_{10, 4};
  LocalMap local_map_{100};
};

TEST_F(LocalMapTest, HasThePointsThatReferenceAndNeighboursSeeOnceEach) {
  const PointId own = add_point({k(1)}), shared = add_point({k(0), k(1), k(2)}),
                of_neighbour = add_point({k(2)});
  const PointId from_afar = add_point({k(3), k(0)});
  add_point({k(3)});
  publish();
  update(k(1));
  EXPECT_EQ(ids(), (std::multiset{own, shared, of_neighbour, from_afar}));
  ASSERT_EQ(local_map_.neighbours().size(), 3U);
  EXPECT_EQ(local_map_.neighbours()[0], k(1));
  const auto [first, last] = local_map_.reference_range();
  ASSERT_EQ(last - first, 2U);
  EXPECT_EQ(local_map_.points()[first].id, own);
  EXPECT_EQ(local_map_.points()[first + 1].id, shared);
}

TEST_F(LocalMapTest, PointsAreWhereTheMapHasThemFromTheReference) {
  for (const std::uint32_t anchor : {0U, 1U, 2U, 0U}) add_point({k(anchor), k(1)});
  publish();
  ASSERT_EQ(update(k(1)), 4U);
  for (const TrackedPoint& point : local_map_.points()) {
    const MapPoint& in_map = graph_.point(point.id);
    EXPECT_EQ(local_map_.anchor(point), in_map.anchor);
    EXPECT_EQ(point.appearance, in_map.appearance.get());
    EXPECT_EQ(point.immature, -1);
    EXPECT_LT((point.x_ref - graph_.T_k_w(k(1)) * graph_.position(point.id)).norm(), 1e-12);
    EXPECT_LT((local_map_.T_ref_a(point) * from_inverse_depth(point.psi) - point.x_ref).norm(), 1e-12);
  }
}

TEST_F(LocalMapTest, ImmaturePointsComeFirstAndAKeyframeMayBePending) {
  const PointId mapped = add_point({k(3)});
  publish();
  immature_.add_pending({.id = k(4), .reference = k(3), .T_k_ref = SE3(SO3(), {-0.5, 0, 0})});
  immature_.add(immature_point(k(3)));
  immature_.add(immature_point(k(4)));
  ASSERT_EQ(update(k(3)), 3U);
  for (int n = 0; n < 2; ++n) {
    const TrackedPoint& point = local_map_.points()[static_cast<std::size_t>(n)];
    EXPECT_EQ(point.immature, n);
    EXPECT_EQ(point.id, kNoPoint);
    EXPECT_EQ(point.appearance, &immature_.points()[static_cast<std::size_t>(n)].appearance);
  }
  EXPECT_LT((local_map_.points()[1].x_ref - local_map_.points()[0].x_ref - Vector3(0.5, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(local_map_.points()[2].id, mapped);
  ASSERT_EQ(update(k(4)), 2U) << "the map does not know yet who its neighbours are";
  EXPECT_EQ(local_map_.reference_range(), (std::pair<std::size_t, std::size_t>{0, 2}));
  EXPECT_TRUE(local_map_.neighbours().empty());
}

TEST_F(LocalMapTest, LeavesOutWhatIsOfAnotherPartOrCulled) {
  const KeyframeId elsewhere = add_keyframe(k(4));
  const PointId here = add_point({k(1)});
  add_point({elsewhere, k(1)});
  const PointId culled = add_point({k(1), k(2)});
  writer_.cull_point(culled);
  publish();
  immature_.add(immature_point(elsewhere));
  update(k(1));
  EXPECT_EQ(ids(), (std::multiset{here}));
}

TEST_F(LocalMapTest, StaysWithinItsCapacityAndPrefersTheReference) {
  for (std::uint32_t n = 0; n < 3; ++n) add_point({k(2)});
  const std::vector<PointId> own{add_point({k(1)}), add_point({k(1)})};
  publish();
  immature_.add(immature_point(k(1)));
  LocalMap small(4);
  small.update(graph_, k(1), immature_, kNeighbours);
  ASSERT_EQ(small.points().size(), 4U);
  EXPECT_EQ(small.points()[0].immature, 0);
  EXPECT_EQ(small.points()[1].id, own[0]);
  EXPECT_EQ(small.points()[2].id, own[1]);
  EXPECT_EQ(small.reference_range(), (std::pair<std::size_t, std::size_t>{1, 3}));
}

TEST_F(LocalMapTest, TakesTheStrongestNeighbours) {
  const PointId weak = add_point({k(0)}), strong = add_point({k(2)});
  publish();
  update(k(1), 2);
  EXPECT_EQ(ids(), (std::multiset{strong})) << "the reference is the other one of the two";
  LocalMap of_all(100);
  of_all.update(graph_, k(1), immature_, 3);
  ASSERT_EQ(of_all.points().size(), 2U);
  EXPECT_EQ(of_all.points()[1].id, weak);
}

/// Fewer neighbours show whether the points were collected anew.
TEST_F(LocalMapTest, IsCollectedAnewWhenMapReferenceOrImmaturePointsChange) {
  for (std::uint32_t n = 0; n < 4; ++n) add_point({k(n)});
  publish();
  ASSERT_EQ(update(k(1)), 3U);
  EXPECT_EQ(update(k(1), 1), 3U) << "nothing has changed";
  publish();
  EXPECT_EQ(update(k(1), 1), 1U);
  EXPECT_EQ(local_map_.version(), graph_.version());
  EXPECT_EQ(update(k(1)), 1U);
  EXPECT_EQ(update(k(2)), 3U);
  immature_.add(immature_point(k(2)));
  EXPECT_EQ(update(k(2), 1), 2U);
}

TEST_F(LocalMapTest, PosesGoThroughPendingKeyframes) {
  publish();
  const SE3 T(SO3::exp({0, 0.2, 0}), {0.1, 0, 0.3});
  immature_.add_pending({.id = k(4), .reference = k(2), .T_k_ref = T});
  immature_.add_pending({.id = k(5), .reference = k(4), .T_k_ref = T});
  immature_.add_pending({.id = k(6), .reference = kNoKeyframe, .T_k_ref = T});
  const auto distance = [](const SE3& a, const SE3& b) { return (a * b.inverse()).log().norm(); };
  EXPECT_LT(distance(pose_in_world(graph_, immature_, k(5)), T * T * graph_.T_k_w(k(2))), 1e-12);
  EXPECT_LT(distance(pose_relative_to(graph_, immature_, k(5), k(4)), T), 1e-12);
  EXPECT_LT(distance(pose_in_world(graph_, immature_, k(6)), T), 1e-12);
  EXPECT_EQ(part_of(graph_, immature_, k(5)), kPart);
  EXPECT_EQ(part_of(graph_, immature_, k(6)), k(6)) << "the first of a part";
}

}  // namespace
}  // namespace twofold
