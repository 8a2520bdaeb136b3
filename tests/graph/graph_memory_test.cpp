#include <gtest/gtest.h>

#include "fixtures/live_memory.hpp"
#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// A keyframe with a point comes, and both go, over and over, while versions are published: what is held
/// afterwards does not tell how often.
TEST(GraphMemory, WhatWasCulledLeavesNothing) {
  GraphWriter writer;
  const auto add = [&](PointId point) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{static_cast<std::uint32_t>(writer.graph().keyframe_count())};
    writer.add_keyframe(keyframe);
    MapPoint map_point;
    map_point.anchor = keyframe.id;
    writer.add_point(point, map_point);
    return keyframe.id;
  };
  const KeyframeId stays = add(PointId{0});
  GraphSnapshot published;
  const auto come_and_go = [&](std::uint32_t until) {
    for (auto p = static_cast<std::uint32_t>(writer.graph().point_count()); p < until; ++p) {
      const KeyframeId id = add(PointId{p});
      published = writer.publish();
      writer.cull_keyframe(id, stays);
      writer.cull_point(PointId{p});
      writer.forget_replacements(100);
    }
    published = writer.publish();
    return live_heap_bytes();
  };
  const std::size_t after_2000 = come_and_go(2000);
  const std::size_t after_50000 = come_and_go(50000);
  EXPECT_EQ(writer.replacement_count(), 100U);
  // A level or two of inner nodes, for the longer numbers.
  EXPECT_LT(static_cast<double>(after_50000), static_cast<double>(after_2000) + 8192);
}

}  // namespace
}  // namespace twofold
