#include "graph/graph_writer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "geometry/inverse_depth.hpp"
#include "tests/graph/graph_invariants.hpp"
#include "tests/random_pose.hpp"

namespace twofold {
namespace {

KeyframeId add_keyframe(GraphWriter& writer, const SE3& T_k_w = SE3()) {
  Keyframe keyframe;
  keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer.graph().keyframe_count())};
  keyframe.T_k_w = T_k_w;
  writer.add_keyframe(keyframe);
  return keyframe.id;
}

MapPoint anchored_in(KeyframeId anchor) {
  MapPoint point;
  point.anchor = anchor;
  return point;
}

Edge edge_to(KeyframeId other, int weight) {
  Edge edge;
  edge.other = other;
  edge.weight = weight;
  return edge;
}

Observation seen(std::uint32_t point, float u = 0) {
  Observation observation;
  observation.point = PointId{point};
  observation.z = {u, 0, 0};
  return observation;
}

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
  EXPECT_EQ(list[0].z.x(), 1);
  EXPECT_EQ(list[1].z.x(), 2);
  EXPECT_EQ(list[2].z.x(), 2);
  EXPECT_EQ(*writer.graph().point(PointId{2}).observers, ObserverList{a});
}

TEST(GraphWriter, SkippedPointIdsAreCulledPoints) {
  GraphWriter writer;
  const KeyframeId a = add_keyframe(writer);
  writer.add_point(PointId{4}, anchored_in(a));
  EXPECT_EQ(writer.graph().point_count(), 5U);
  for (std::uint32_t p = 0; p < 4; ++p) EXPECT_FALSE(writer.graph().point(PointId{p}).alive());
  EXPECT_TRUE(writer.graph().point(PointId{4}).alive());
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
  writer.set_edge(a, {b, 12, true, T_b_a, 0.3});
  const Edge* back = find_edge(writer.graph().keyframe(b), a);
  ASSERT_NE(back, nullptr);
  EXPECT_LT((back->T_other_this * T_b_a).log().norm(), 1e-12);
  EXPECT_LT((relative_pose(writer.graph(), b, *back) * T_b_a).log().norm(), 1e-12);
  writer.set_edge(b, {a, 7, false, SE3(), 0.1});  // replaced from the other side
  EXPECT_EQ(find_edge(writer.graph().keyframe(a), b)->weight, 7);
  const SE3 T_b_a_absolute = writer.graph().T_k_w(b) * writer.graph().T_k_w(a).inverse();
  const SE3 T_a_b = relative_pose(writer.graph(), b, *find_edge(writer.graph().keyframe(b), a));
  EXPECT_LT((T_a_b * T_b_a_absolute).log().norm(), 1e-12);
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  writer.remove_edge(b, a);
  EXPECT_TRUE(writer.graph().keyframe(a).edges->empty());
  EXPECT_TRUE(writer.graph().keyframe(b).edges->empty());
}

TEST(GraphWriter, CulledKeyframesAndTheirPointsFollowTheirHeirs) {
  std::mt19937 rng(4);
  GraphWriter writer;
  std::vector<KeyframeId> k;
  for (int i = 0; i < 4; ++i) k.push_back(add_keyframe(writer, random_pose(rng)));
  MapPoint point = anchored_in(k[0]);
  point.psi = {0.1, -0.2, 0.5};
  writer.add_point(PointId{0}, point);
  writer.add_observations(k[0], std::vector{seen(0)});
  writer.add_observations(k[2], std::vector{seen(0)});
  for (int i = 0; i < 3; ++i) writer.set_edge(k[0], edge_to(k[static_cast<std::size_t>(i + 1)], 10));
  const SE3 T_0_3 = writer.graph().T_k_w(k[0]) * writer.graph().T_k_w(k[3]).inverse();
  const Vector3 position = writer.graph().position(PointId{0});

  writer.cull_keyframe(k[0], k[1]);
  writer.cull_keyframe(k[1], k[2]);
  writer.cull_keyframe(k[2], k[3]);  // a chain of heirs
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  EXPECT_LT((writer.graph().position(PointId{0}) - position).norm(), 1e-12);

  writer.shorten_heirs(k[0]);
  EXPECT_EQ(writer.graph().heir(k[0]).id, k[3]);
  writer.shorten_heirs(k[3]);  // nothing to do for one that stayed
  EXPECT_FALSE(writer.graph().keyframe(k[3]).culled());
  EXPECT_EQ(broken_invariant(writer.graph()), "");

  EXPECT_TRUE(writer.graph().keyframe(k[0]).culled());
  EXPECT_EQ(writer.graph().survivor(k[1])->id, k[3]);
  EXPECT_EQ(writer.graph().survivor(k[3])->id, k[3]);
  EXPECT_EQ(writer.graph().part(k[0]), writer.graph().keyframe(k[3]).part);
  writer.set_part(k[3], k[3]);
  EXPECT_EQ(writer.graph().part(k[0]), k[3]);

  const SE3 T_3_w = random_pose(rng);
  writer.set_pose(k[3], T_3_w);
  EXPECT_LT((writer.graph().T_k_w(k[0]) * (T_0_3 * T_3_w).inverse()).log().norm(), 1e-10);
  EXPECT_DEATH(writer.cull_keyframe(k[3], k[0]), "heir");
  EXPECT_DEATH(writer.set_edge(k[3], edge_to(k[0], 1)), "culled");
}

TEST(GraphWriter, OldHeirsAreForgottenButForThoseThatPointsHangOn) {
  std::mt19937 rng(5);
  GraphWriter writer;
  std::vector<KeyframeId> k;
  for (int i = 0; i < 7; ++i) k.push_back(add_keyframe(writer, random_pose(rng)));
  for (std::uint32_t p = 0; p < 2; ++p) {
    MapPoint point = anchored_in(k[1]);
    point.psi = {0.1, -0.2, 0.5};
    writer.add_point(PointId{p}, point);
  }
  const Vector3 position = writer.graph().position(PointId{0});
  for (std::size_t i = 0; i < 5; ++i) writer.cull_keyframe(k[i], k[i + 1]);
  writer.forget_heirs(2);
  EXPECT_EQ(writer.heir_count(), 3U);  // k[1] and the newest two
  const GraphSnapshot published = writer.publish();
  for (const std::size_t gone : {0U, 2U}) {
    EXPECT_FALSE(published.survivor(k[gone]));
    EXPECT_EQ(published.part(k[gone]), kNoKeyframe);
  }
  for (const std::size_t left : {1U, 3U, 4U}) EXPECT_EQ(published.survivor(k[left])->id, k[5]);
  EXPECT_LT((published.position(PointId{0}) - position).norm(), 1e-12);
  EXPECT_EQ(broken_invariant(published), "");

  writer.cull_point(PointId{0});
  writer.forget_heirs(0);
  EXPECT_EQ(writer.heir_count(), 1U);
  writer.cull_point(PointId{1});  // the last one
  writer.forget_heirs(0);
  EXPECT_EQ(writer.heir_count(), 0U);
  EXPECT_EQ(broken_invariant(writer.graph()), "");
  EXPECT_EQ(known_heirs(published), 3U) << "a version that was published stays as it is";
  EXPECT_DEATH((void)writer.graph().T_k_w(k[1]), "forgotten");
  EXPECT_DEATH(writer.add_point(PointId{2}, anchored_in(k[1])), "anchor");
}

/// Keyframes and points come and go; keyframes are culled in any order, so that heirs hang on heirs.
TEST(GraphWriter, PlacesOfPointsSurviveForgetting) {
  constexpr std::size_t kKeep = 15;
  for (unsigned seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 rng(seed);
    GraphWriter writer;
    std::vector<KeyframeId> live, culled;
    std::map<std::uint32_t, Vector3> positions;
    std::uint32_t points = 0;
    std::size_t most_anchors = 0;
    for (int step = 0; step < 600; ++step) {
      live.push_back(add_keyframe(writer, random_pose(rng)));
      for (int n = 0; n < 2; ++n, ++points) {
        MapPoint point = anchored_in(live[rng() % live.size()]);
        point.psi = {0.1, -0.2, 0.5};
        writer.add_point(PointId{points}, point);
        positions[points] = writer.graph().position(PointId{points});
        if (positions.size() <= 40) continue;
        const auto gone = std::next(positions.begin(), rng() % positions.size());
        writer.cull_point(PointId{gone->first});
        positions.erase(gone);
      }
      if (live.size() <= 8) continue;
      const auto at = live.begin() + static_cast<std::ptrdiff_t>(rng() % live.size());
      culled.push_back(*at);
      live.erase(at);
      writer.cull_keyframe(culled.back(), live[rng() % live.size()]);
      writer.forget_heirs(kKeep);
      if (step % 10 == 0) {
        ASSERT_EQ(broken_invariant(writer.graph()), "");
      }
      for (std::size_t n = culled.size() - std::min(kKeep, culled.size()); n < culled.size(); ++n) {
        ASSERT_TRUE(writer.graph().survivor(culled[n]));
      }
      most_anchors = std::max(most_anchors, culled_anchors(writer.graph()));
      ASSERT_LE(writer.heir_count(), kKeep + 2 * most_anchors);
      ASSERT_EQ(writer.heir_count(), known_heirs(writer.graph()));
    }
    for (const auto& [p, position] : positions) {
      ASSERT_LT((writer.graph().position(PointId{p}) - position).norm(), 1e-9 * (1 + position.norm()));
    }
    GraphWriter adopted(writer.publish());
    EXPECT_EQ(adopted.heir_count(), writer.heir_count());
    adopted.keep_needed_heirs();
    EXPECT_EQ(adopted.heir_count(), culled_anchors(adopted.graph()));
    EXPECT_EQ(broken_invariant(adopted.graph()), "");
  }
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
                        {KeyframeId{b}, static_cast<int>(rng() % 50), rng() % 2 == 0, random_pose(rng), 0.1});
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
        writer.forget_heirs(3);
        for (auto& [p, set] : observers) set.erase(k);
        std::erase_if(edges, [&](const auto& e) { return e.first == k || e.second == k; });
      }
      if (step % 100 == 99) published.emplace_back(writer.publish(), live.size());
    }
    ASSERT_EQ(broken_invariant(writer.graph()), "");
    for (const auto& [snapshot, count] : published) ASSERT_EQ(broken_invariant(snapshot), "");
    for (std::uint32_t p = 0; p < points; ++p) {
      const MapPoint& point = writer.graph().point(PointId{p});
      ASSERT_EQ(point.alive(), observers.contains(p));
      if (!point.alive()) continue;
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
