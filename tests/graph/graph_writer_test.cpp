#include "graph/graph_writer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "fixtures/graph_invariants.hpp"
#include "tests/graph/graph_pieces.hpp"
#include "tests/random_pose.hpp"

namespace twofold {
namespace {

using testing::add_keyframe;
using testing::anchored_in;
using testing::edge_to;
using testing::seen;

TEST(GraphWriter, PublishedVersionsAreNumberedAndUnaffectedByLaterWrites) {
  GraphWriter writer;
  const KeyframeId a = add_keyframe(writer);
  writer.add_point(PointId{0}, anchored_in(a));
  const GraphSnapshot first = writer.publish();
  const std::vector<Observation> observations{seen(0, 5)};
  writer.add_observations(a, observations);
  writer.set_pose(a, SE3(SO3(), {1, 2, 3}));
  const KeyframeId b = add_keyframe(writer);
  writer.set_edge(a, edge_to(b, 3));
  const GraphSnapshot second = writer.publish();
  EXPECT_EQ(first.version(), 1U);
  EXPECT_EQ(second.version(), 2U);
  EXPECT_EQ(first.keyframe_count(), 1U);
  EXPECT_TRUE(first.keyframe(a).observations->empty());
  EXPECT_TRUE(first.point(PointId{0}).observers->empty());
  EXPECT_EQ(first.keyframe(a).T_k_w.translation(), Vector3(0, 0, 0));
  EXPECT_EQ(second.keyframe(a).T_k_w.translation(), Vector3(1, 2, 3));
  EXPECT_EQ(broken_invariant(first), "");
  EXPECT_EQ(broken_invariant(second), "");
}

TEST(GraphWriter, NewMeasurementsReplaceOldOnesOfTheSamePoint) {
  GraphWriter writer;
  const KeyframeId a = add_keyframe(writer);
  for (std::uint32_t p = 0; p < 3; ++p) writer.add_point(PointId{p}, anchored_in(a));
  writer.add_observations(a, std::vector{seen(2, 1), seen(0, 1)});
  writer.add_observations(a, std::vector{seen(1, 2), seen(2, 2)});
  const auto& list = *writer.graph().keyframe(a).observations;
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[0].pixel.x(), 1);
  EXPECT_EQ(list[1].pixel.x(), 2);
  EXPECT_EQ(list[2].pixel.x(), 2);
  EXPECT_EQ(*writer.graph().point(PointId{2}).observers, ObserverList{a});
}

TEST(GraphWriter, SkippedPointIdsAreCulledPoints) {
  GraphWriter writer;
  const KeyframeId a = add_keyframe(writer);
  writer.add_point(PointId{4}, anchored_in(a));
  EXPECT_EQ(writer.graph().point_count(), 5U);
  for (std::uint32_t p = 0; p < 4; ++p) EXPECT_TRUE(writer.graph().point(PointId{p}).culled());
  EXPECT_FALSE(writer.graph().point(PointId{4}).culled());
  writer.cull_point(PointId{1});  // culling what is culled changes nothing
  EXPECT_DEATH(writer.add_observations(a, std::vector{seen(1)}), "culled point");
  EXPECT_DEATH(writer.add_point(PointId{3}, anchored_in(a)), "order of ids");
}

TEST(GraphWriter, EdgesAreSymmetricWithInverseRelativePoses) {
  std::mt19937 rng(3);
  GraphWriter writer;
  const KeyframeId a = add_keyframe(writer, random_pose(rng));
  const KeyframeId b = add_keyframe(writer, random_pose(rng));
  const SE3 T_b_a = random_pose(rng);
  writer.set_edge(a, {b, 12, true, T_b_a});
  const Edge* back = find_edge(writer.graph().keyframe(b), a);
  ASSERT_NE(back, nullptr);
  EXPECT_LT((back->T_other_this * T_b_a).log().norm(), 1e-12);
  EXPECT_LT((relative_pose(writer.graph(), b, *back) * T_b_a).log().norm(), 1e-12);
  writer.set_edge(b, {a, 7, false, SE3()});  // replaced from the other side
  EXPECT_EQ(find_edge(writer.graph().keyframe(a), b)->weight, 7);
  const SE3 T_b_a_absolute = writer.graph().T_k_w(b) * writer.graph().T_k_w(a).inverse();
  const SE3 T_a_b = relative_pose(writer.graph(), b, *find_edge(writer.graph().keyframe(b), a));
  EXPECT_LT((T_a_b * T_b_a_absolute).log().norm(), 1e-12);
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  writer.remove_edge(b, a);
  EXPECT_TRUE(writer.graph().keyframe(a).edges->empty());
  EXPECT_TRUE(writer.graph().keyframe(b).edges->empty());
}

/// Random life of a graph against plain sets.
TEST(GraphWriter, InvariantsHoldUnderRandomOperations) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 rng(seed);
    GraphWriter writer;
    std::map<std::uint32_t, std::set<std::uint32_t>> observers;  // point -> keyframes
    std::set<std::pair<std::uint32_t, std::uint32_t>> edges;     // (lower, higher)
    std::vector<std::uint32_t> live;
    std::vector<std::pair<GraphSnapshot, std::size_t>> published;
    std::uint32_t points = 0;
    for (int step = 0; step < 1500; ++step) {
      const unsigned action = rng() % 20;
      const auto pick = [&] { return live[rng() % live.size()]; };
      if (live.size() < 3 || action < 3) {
        live.push_back(index(add_keyframe(writer, random_pose(rng))));
      } else if (action < 6) {
        writer.add_point(PointId{points}, anchored_in(KeyframeId{pick()}));
        observers[points++];
      } else if (action < 12 && points > 0) {
        const std::uint32_t k = pick();
        std::vector<Observation> added;
        for (std::uint32_t p = rng() % 3; p < points; p += 1 + rng() % 7) {
          if (!observers.contains(p)) continue;
          added.push_back(seen(p));
          observers[p].insert(k);
        }
        writer.add_observations(KeyframeId{k}, added);
      } else if (action < 14) {
        const std::uint32_t k = pick();
        std::vector<PointId> removed;
        for (std::uint32_t p = 0; p < points; p += 1 + rng() % 5) {
          removed.push_back(PointId{p});
          if (observers.contains(p)) observers[p].erase(k);
        }
        writer.remove_observations(KeyframeId{k}, removed);
      } else if (action < 17) {
        const std::uint32_t a = pick(), b = pick();
        if (a == b) continue;
        writer.set_edge(KeyframeId{a},
                        {KeyframeId{b}, static_cast<int>(rng() % 50), rng() % 2 == 0, random_pose(rng)});
        edges.insert(std::minmax(a, b));
      } else if (action == 17) {
        const std::uint32_t a = pick(), b = pick();
        writer.remove_edge(KeyframeId{a}, KeyframeId{b});
        edges.erase(std::minmax(a, b));
      } else if (action == 18 && !observers.empty()) {
        const std::uint32_t p = std::next(observers.begin(), rng() % observers.size())->first;
        writer.cull_point(PointId{p});
        observers.erase(p);
      } else if (live.size() > 5) {
        const std::uint32_t k = pick();
        live.erase(std::find(live.begin(), live.end(), k));
        writer.cull_keyframe(KeyframeId{k}, KeyframeId{pick()});
        writer.forget_replacements(3);
        for (auto& [p, set] : observers) set.erase(k);
        std::erase_if(edges, [&](const auto& e) { return e.first == k || e.second == k; });
      }
      if (step % 100 == 99) published.emplace_back(writer.publish(), live.size());
    }
    ASSERT_EQ(broken_invariant(writer.graph()), "");
    for (const auto& [snapshot, count] : published) ASSERT_EQ(broken_invariant(snapshot), "");
    for (std::uint32_t p = 0; p < points; ++p) {
      const MapPoint& point = writer.graph().point(PointId{p});
      ASSERT_EQ(!point.culled(), observers.contains(p));
      if (point.culled()) continue;
      std::set<std::uint32_t> ids;
      for (const KeyframeId k : *point.observers) ids.insert(index(k));
      ASSERT_EQ(ids, observers[p]);
    }
    std::set<std::pair<std::uint32_t, std::uint32_t>> found;
    for (const std::uint32_t k : live) {
      for (const Edge& e : *writer.graph().keyframe(KeyframeId{k}).edges) {
        found.insert(std::minmax(k, index(e.other)));
      }
    }
    ASSERT_EQ(found, edges);
  }
}

}  // namespace
}  // namespace twofold
