#include "graph/part_extraction.hpp"

#include <gtest/gtest.h>

#include "fixtures/graph_invariants.hpp"
#include "tests/graph/sample_map.hpp"

namespace twofold {
namespace {

/// Same keyframes, and the same living points in the same order.
void expect_same(const SavedMap& a, const SavedMap& b) {
  ASSERT_EQ(a.graph.keyframe_count(), b.graph.keyframe_count());
  EXPECT_EQ(a.graph.reference(), b.graph.reference());
  for (std::uint32_t i = 0; i < a.graph.keyframe_count(); ++i) {
    const KeyframeId k{i};
    EXPECT_EQ(a.graph.T_k_w(k).matrix(), b.graph.T_k_w(k).matrix());
    ASSERT_EQ(a.graph.keyframe(k).culled(), b.graph.keyframe(k).culled());
    if (a.graph.keyframe(k).culled()) {
      EXPECT_EQ(a.graph.replacement(k).id, b.graph.replacement(k).id);
    }
    EXPECT_EQ(a.graph.keyframe(k).edges->size(), b.graph.keyframe(k).edges->size());
    EXPECT_EQ(a.graph.keyframe(k).observations->size(), b.graph.keyframe(k).observations->size());
    ASSERT_EQ(a.places.find(k) == nullptr, b.places.find(k) == nullptr);
    if (a.places.find(k) != nullptr) {
      EXPECT_EQ(a.places.find(k)->corners.size(), b.places.find(k)->corners.size());
    }
  }
  const auto psi = [](const GraphSnapshot& graph) {
    std::vector<double> values;
    for (std::uint32_t p = 0; p < graph.point_count(); ++p) {
      const MapPoint& point = graph.point(PointId{p});
      if (!point.culled()) values.push_back(point.psi.z() + index(point.anchor));
    }
    return values;
  };
  EXPECT_EQ(psi(a.graph), psi(b.graph));
}

TEST(PartExtraction, PartsComeOutAsTheyWentIn) {
  const SavedMap first = testing::sample_map(20, 120, 1), second = testing::sample_map(11, 60, 2);
  const SavedMap both = testing::two_parts(first, second);
  ASSERT_EQ(broken_invariant(both.graph), "");
  EXPECT_EQ(parts_of(both.graph), (std::vector<KeyframeId>{KeyframeId{0}, KeyframeId{20}}));
  const SavedMap a = extract_part(both.rig, both.graph, both.places, KeyframeId{0});
  const SavedMap b = extract_part(both.rig, both.graph, both.places, KeyframeId{20});
  for (const SavedMap* map : {&a, &b}) {
    EXPECT_EQ(broken_invariant(map->graph), "");
    EXPECT_EQ(parts_of(map->graph), std::vector<KeyframeId>{KeyframeId{0}});
  }
  expect_same(b, second);
  // Its reference was left behind: the newest keyframe that is there
  expect_same(a, first);
}

TEST(PartExtraction, CulledKeyframesComeAlongOnlyWithPoints) {
  const SavedMap map = testing::sample_map(40, 240, 4);
  GraphWriter writer(map.graph);
  const KeyframeId without{4}, with{13};
  for (std::uint32_t p = 0; p < writer.graph().point_count(); ++p) {
    if (writer.graph().point(PointId{p}).anchor == without) writer.cull_point(PointId{p});
  }
  const std::size_t known = known_replacements(writer.graph());
  const SavedMap part = extract_part(map.rig, writer.publish(), map.places, KeyframeId{0});
  EXPECT_EQ(part.graph.keyframe_count(), map.graph.keyframe_count() - 1);
  EXPECT_EQ(known_replacements(part.graph), known - 1);
  EXPECT_TRUE(part.graph.live_replacement(KeyframeId{index(with) - 1}));
  EXPECT_EQ(broken_invariant(part.graph), "");
  EXPECT_EQ(oldest_part(part.graph), KeyframeId{0});
  writer.forget_replacements(0, known);
  const SavedMap same = extract_part(map.rig, writer.publish(), map.places, KeyframeId{0});
  expect_same(part, same);
  EXPECT_EQ(oldest_part(GraphSnapshot()), kNoKeyframe);
}

TEST(PartExtraction, NamesFollowEdgesAndReplacements) {
  GraphWriter writer(testing::sample_map(30, 90, 3).graph);
  name_parts(writer);
  EXPECT_EQ(parts_of(writer.graph()).size(), static_cast<std::size_t>(component_count(writer.graph())));
  for (std::uint32_t k = 0; k < writer.graph().keyframe_count(); ++k) {
    const Keyframe& keyframe = writer.graph().keyframe(KeyframeId{k});
    for (const Edge& edge : *keyframe.edges)
      EXPECT_EQ(writer.graph().keyframe(edge.other).part, keyframe.part);
    if (keyframe.culled()) {
      EXPECT_EQ(writer.graph().part(writer.graph().replacement(KeyframeId{k}).id),
                writer.graph().part(KeyframeId{k}));
    }
  }
}

}  // namespace
}  // namespace twofold
