#include "slam/map_movements.hpp"

#include <gtest/gtest.h>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// Four keyframes in a row, and the mapper that moves them.
class MapMovementsTest : public ::testing::Test {
 protected:
  MapMovementsTest() {
    for (std::uint32_t k = 0; k < 4; ++k) {
      Keyframe keyframe;
      keyframe.id = KeyframeId{k};
      writer_.add_keyframe(std::move(keyframe));
    }
    publish();
    (void)movements_.take(graph_.version());
  }
  void publish() {
    graph_ = writer_.publish();
    movements_.made(graph_, window_);
  }
  void move(std::uint32_t k, double distance) {
    writer_.set_pose(KeyframeId{k}, SE3(SO3(), Vector3(distance, 0, 0)));
  }
  void close_loop() {
    ClosedLoop loop;
    loop.constraint.from = KeyframeId{0};
    loop.constraint.to = KeyframeId{3};
    movements_.found(loop);
  }
  void take_loop() {
    Edge edge;
    edge.other = KeyframeId{3};
    writer_.set_edge(KeyframeId{0}, edge);
  }

  GraphWriter writer_;
  GraphSnapshot graph_;
  DoubleWindow window_;
  MapMovements movements_;
};

TEST_F(MapMovementsTest, AJumpIsComparedOverAllKeyframesAndNamesItsLoop) {
  close_loop();
  publish();
  EXPECT_EQ(movements_.take(graph_.version()).loop_to, kNoKeyframe) << "the map does not have it yet";
  take_loop();
  move(1, 0.02);
  move(2, 0.5);
  move(3, 0.005);
  writer_.announce_change(MapChange::Kind::kLoopClosure);
  publish();
  const MapMovement movement = movements_.take(graph_.version());
  EXPECT_EQ(movement.keyframes, 2U);
  EXPECT_NEAR(movement.farthest, 0.5, 1e-12);
  EXPECT_EQ(movement.loop_from, KeyframeId{0});
  EXPECT_EQ(movement.loop_to, KeyframeId{3});
  EXPECT_EQ(movements_.take(graph_.version()).keyframes, 0U) << "it was taken";
}

TEST_F(MapMovementsTest, ThePoseGraphsOptimisationHasTheLoopItIsFor) {
  close_loop();
  take_loop();
  writer_.announce_change(MapChange::Kind::kLoopClosure);
  publish();
  (void)movements_.take(graph_.version());
  move(0, 0.1);
  writer_.announce_change(MapChange::Kind::kPoseGraph);
  publish();
  EXPECT_EQ(movements_.take(graph_.version()).loop_to, KeyframeId{3});
}

TEST_F(MapMovementsTest, ARoundIsComparedOverItsWindow) {
  move(1, 0.3);
  move(2, 0.2);
  window_.nodes.push_back({});
  window_.nodes.back().id = KeyframeId{2};
  publish();
  const MapMovement movement = movements_.take(graph_.version());
  EXPECT_EQ(movement.keyframes, 1U);
  EXPECT_NEAR(movement.farthest, 0.2, 1e-12);
}

TEST_F(MapMovementsTest, VersionsThatTheTrackerHasNotSeenAreKeptForIt) {
  window_.nodes.push_back({});
  window_.nodes.back().id = KeyframeId{2};
  const std::uint64_t seen = graph_.version();
  double at = 0;
  for (int n = 0; n < 1000; ++n) {  // more than the ring holds
    at += n == 500 ? 1 : 0.02;
    move(2, at);
    publish();
  }
  EXPECT_EQ(movements_.take(seen).keyframes, 0U);
  MapMovement all = movements_.take(graph_.version());
  const double first = all.farthest;
  publish();  // hands over what found no room
  all = movements_.take(graph_.version());
  EXPECT_NEAR(std::max(first, all.farthest), 1, 1e-9);
  EXPECT_EQ(all.keyframes, 1U);
  EXPECT_EQ(all.version, graph_.version());
}

}  // namespace
}  // namespace twofold
