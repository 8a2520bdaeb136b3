#include "graph/neighbourhood.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <queue>
#include <random>
#include <set>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

void add_keyframes(GraphWriter& writer, std::uint32_t count) {
  for (std::uint32_t k = 0; k < count; ++k) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    writer.add_keyframe(keyframe);
  }
}

Edge edge_to(std::uint32_t other, int weight) {
  Edge edge;
  edge.other = KeyframeId{other};
  edge.weight = weight;
  return edge;
}

void add_point(GraphWriter& writer, std::uint32_t id) {
  MapPoint point;
  point.anchor = KeyframeId{0};
  writer.add_point(PointId{id}, point);
}

GraphWriter random_graph(std::mt19937& rng, std::uint32_t keyframes, int edges) {
  GraphWriter writer;
  add_keyframes(writer, keyframes);
  for (int e = 0; e < edges; ++e) {
    const std::uint32_t a = rng() % keyframes, b = rng() % keyframes;
    if (a != b) writer.set_edge(KeyframeId{a}, edge_to(b, static_cast<int>(1 + rng() % 9)));
  }
  return writer;
}

/// Hop distance by Bellman's relaxation: shares nothing with the search it judges.
std::vector<int> distances(const GraphSnapshot& graph, std::uint32_t root) {
  const int far = 1 << 20;
  std::vector<int> d(graph.keyframe_count(), far);
  d[root] = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (std::uint32_t k = 0; k < d.size(); ++k) {
      for (const Edge& e : *graph.keyframe(KeyframeId{k}).edges) {
        if (d[k] + 1 < d[index(e.other)]) {
          d[index(e.other)] = d[k] + 1;
          changed = true;
        }
      }
    }
  }
  return d;
}

TEST(WeightedBreadthFirst, MatchesBruteForceOnRandomGraphs) {
  VisitedSet visited;
  std::vector<TreeNode> tree;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 rng(seed);
    const GraphWriter writer = random_graph(rng, 60, 90);
    const GraphSnapshot& graph = writer.graph();
    const std::vector<int> d = distances(graph, seed);
    const std::size_t reachable =
        static_cast<std::size_t>(std::count_if(d.begin(), d.end(), [](int x) { return x < 1 << 20; }));
    for (const std::size_t max_count : {std::size_t{1}, std::size_t{7}, std::size_t{25}, std::size_t{100}}) {
      weighted_breadth_first(graph, KeyframeId{seed}, max_count, visited, tree);
      ASSERT_EQ(tree.size(), std::min(max_count, reachable));
      std::set<KeyframeId> members;
      for (std::size_t n = 0; n < tree.size(); ++n) {
        ASSERT_TRUE(members.insert(tree[n].id).second) << "met twice";
        ASSERT_TRUE(visited.contains(index(tree[n].id)));
        if (n == 0) continue;
        const int depth = d[index(tree[n].id)];
        ASSERT_GE(depth, d[index(tree[n - 1].id)]) << "not level by level";
        const KeyframeId parent = tree[static_cast<std::size_t>(tree[n].parent)].id;
        ASSERT_EQ(d[index(parent)], depth - 1);
        // The tree takes the strongest edge to the level above.
        const int weight = find_edge(graph.keyframe(tree[n].id), parent)->weight;
        for (const Edge& e : *graph.keyframe(tree[n].id).edges) {
          if (d[index(e.other)] == depth - 1) {
            ASSERT_LE(e.weight, weight);
          }
        }
        if (depth == d[index(tree[n - 1].id)] && tree[n - 1].parent >= 0) {
          const KeyframeId before = tree[static_cast<std::size_t>(tree[n - 1].parent)].id;
          ASSERT_GE(find_edge(graph.keyframe(tree[n - 1].id), before)->weight, weight) << "weaker one first";
        }
      }
    }
  }
}

TEST(WeightedBreadthFirst, TiesGoToTheLowerId) {
  GraphWriter writer;
  add_keyframes(writer, 5);
  for (const std::uint32_t k : {4U, 2U, 3U, 1U}) {
    writer.set_edge(KeyframeId{0}, edge_to(k, 5));
  }
  VisitedSet visited;
  std::vector<TreeNode> tree;
  weighted_breadth_first(writer.graph(), KeyframeId{0}, 4, visited, tree);
  ASSERT_EQ(tree.size(), 4U);
  for (std::uint32_t n = 0; n < 4; ++n) EXPECT_EQ(index(tree[n].id), n);
}

TEST(WeightedBreadthFirst, EmptyGraphAndUnknownRootGiveNothing) {
  GraphWriter writer;
  VisitedSet visited;
  std::vector<TreeNode> tree{{KeyframeId{3}, -1}};
  weighted_breadth_first(writer.graph(), KeyframeId{0}, 10, visited, tree);
  EXPECT_TRUE(tree.empty());
  weighted_breadth_first(writer.graph(), kNoKeyframe, 10, visited, tree);
  EXPECT_TRUE(tree.empty());
}

TEST(ForEachComponent, MeetsEveryKeyframeOnceTheReferencesComponentFirst) {
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 rng(seed);
    GraphWriter writer = random_graph(rng, 60, 45);  // few edges: many components
    writer.set_reference(KeyframeId{seed + 20});
    writer.cull_keyframe(KeyframeId{seed}, KeyframeId{seed + 1});
    const GraphSnapshot& graph = writer.graph();
    VisitedSet visited;
    std::vector<TreeNode> expected;
    std::set<KeyframeId> met;
    KeyframeId previous_root = kNoKeyframe;
    for_each_component(graph, [&](const std::vector<TreeNode>& tree) {
      const KeyframeId root = tree.front().id;
      if (met.empty()) {
        EXPECT_EQ(root, graph.reference());
      } else {
        for (const TreeNode& node : tree) EXPECT_LE(root, node.id) << "not rooted at its oldest keyframe";
        EXPECT_TRUE(previous_root == kNoKeyframe || previous_root < root);
        previous_root = root;
      }
      weighted_breadth_first(graph, root, graph.keyframe_count(), visited, expected);
      ASSERT_EQ(tree.size(), expected.size());
      for (std::size_t n = 0; n < tree.size(); ++n) {
        EXPECT_EQ(tree[n].id, expected[n].id);
        EXPECT_EQ(tree[n].parent, expected[n].parent);
        EXPECT_TRUE(met.insert(tree[n].id).second) << "met twice";
      }
    });
    EXPECT_EQ(met.size(), 59U);
    EXPECT_FALSE(met.contains(KeyframeId{seed})) << "was culled";
  }
}

TEST(ForEachComponent, AnEmptyGraphHasNone) {
  for_each_component(GraphWriter().graph(), [](const std::vector<TreeNode>&) { FAIL(); });
}

TEST(DirectNeighbours, StrongestFirstAndBounded) {
  std::mt19937 rng(5);
  const GraphWriter writer = random_graph(rng, 20, 80);
  for (std::uint32_t k = 0; k < 20; ++k) {
    const Keyframe& keyframe = writer.graph().keyframe(KeyframeId{k});
    std::vector<KeyframeId> all{KeyframeId{999}};  // results are appended
    direct_neighbours(writer.graph(), keyframe.id, 1000, all);
    ASSERT_EQ(all.size(), keyframe.edges->size() + 2);
    EXPECT_EQ(all[0], KeyframeId{999});
    EXPECT_EQ(all[1], keyframe.id);
    for (std::size_t n = 3; n < all.size(); ++n) {
      const int before = find_edge(keyframe, all[n - 1])->weight, here = find_edge(keyframe, all[n])->weight;
      EXPECT_TRUE(before > here || (before == here && all[n - 1] < all[n]));
    }
    std::vector<KeyframeId> some;
    direct_neighbours(writer.graph(), keyframe.id, 3, some);
    ASSERT_EQ(some.size(), std::min<std::size_t>(3, keyframe.edges->size() + 1));
    for (std::size_t n = 0; n < some.size(); ++n) EXPECT_EQ(some[n], all[n + 1]);
  }
}

TEST(VisiblePoints, EachPointOnceAndOnlyPointsAlive) {
  std::mt19937 rng(6);
  GraphWriter writer;
  add_keyframes(writer, 6);
  for (std::uint32_t p = 0; p < 100; ++p) add_point(writer, p);
  std::set<PointId> expected;
  const std::vector<KeyframeId> asked{KeyframeId{4}, KeyframeId{1}, KeyframeId{2}};
  for (std::uint32_t k = 0; k < 6; ++k) {
    std::vector<Observation> seen;
    for (std::uint32_t p = 0; p < 100; ++p) {
      if (rng() % 4 != 0) continue;
      seen.emplace_back().point = PointId{p};
      if (std::count(asked.begin(), asked.end(), KeyframeId{k}) > 0) expected.insert(PointId{p});
    }
    writer.add_observations(KeyframeId{k}, seen);
  }
  writer.cull_point(PointId{50});
  expected.erase(PointId{50});
  VisitedSet visited;
  for (int round = 0; round < 3; ++round) {  // scratch is reused
    std::vector<PointId> points;
    visible_points(writer.graph(), asked, visited, points);
    EXPECT_EQ(points.size(), expected.size());
    EXPECT_EQ(std::set<PointId>(points.begin(), points.end()), expected);
  }
}

TEST(IdMap, HoldsWhatWasSetInThisRoundWhateverTheIds) {
  std::mt19937 rng(3);
  IdMap map;
  for (int round = 0; round < 20; ++round) {
    std::map<std::uint32_t, int> truth;
    for (int n = 0; n < 500; ++n) {
      const std::uint32_t id = rng() % 3 == 0 ? rng() % 200 : rng();
      EXPECT_EQ(map.find(id), truth.contains(id) ? truth[id] : -1);
      map.set(id, n);
      truth[id] = n;
    }
    for (const auto& [id, value] : truth) ASSERT_EQ(map.find(id), value);
    EXPECT_EQ(map.find(0xffffffffU), -1);
    map.clear();
    for (const auto& [id, value] : truth) ASSERT_EQ(map.find(id), -1);
  }
}

TEST(VisitedSet, RoundsForgetAndIdsBeyondTheRoundAreABug) {
  VisitedSet visited;
  visited.reset(10);
  EXPECT_TRUE(visited.insert(3));
  EXPECT_FALSE(visited.insert(3));
  EXPECT_TRUE(visited.contains(3));
  visited.reset(10);
  EXPECT_FALSE(visited.contains(3));
  EXPECT_TRUE(visited.insert(3));
  EXPECT_FALSE(visited.contains(1000));
  EXPECT_DEATH(visited.insert(10), "beyond the size");
}

}  // namespace
}  // namespace twofold
