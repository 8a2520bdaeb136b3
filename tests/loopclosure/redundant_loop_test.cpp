#include "loopclosure/redundant_loop.hpp"

#include <gtest/gtest.h>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

constexpr double kMedianDepth = 4;
constexpr KeyframeId kFrom{0}, kTo{5};

/// Keyframes 0 to 5 along a line, each joined to the next by an edge, before a wall.
class RedundantLoopTest : public ::testing::Test {
 protected:
  GraphSnapshot line(double step, int edges = 5, double roll = 0) {
    GraphWriter writer;
    for (std::uint32_t k = 0; k <= index(kTo); ++k) {
      Keyframe keyframe;
      keyframe.id = KeyframeId{k};
      keyframe.part = kFrom;
      keyframe.T_k_w = SE3(SO3::exp({0, 0, roll * k}), Vector3(-step * k, 0, 0));
      keyframe.median_depth = median_depth_;
      writer.add_keyframe(keyframe);
      writer.set_reference(keyframe.id);
    }
    for (int k = 0; k < edges; ++k) {
      Edge edge;
      edge.other = KeyframeId{static_cast<std::uint32_t>(k) + 1};
      edge.weight = 50;
      writer.set_edge(KeyframeId{static_cast<std::uint32_t>(k)}, edge);
    }
    return writer.publish();
  }
  /// What the images say: where the map has it, but for `error` and a scale.
  static LoopConstraint loop(const GraphSnapshot& graph, const SE3& error = SE3(), double scale = 1) {
    const SE3 T = error * graph.T_k_w(kTo) * graph.T_k_w(kFrom).inverse();
    return {graph.version(), kFrom, kTo, SE3(T.so3(), scale * T.translation()), 100, 100, scale};
  }
  bool redundant(const LoopConstraint& loop, const GraphSnapshot& graph) {
    return loops_.has(loop, wall_, graph);
  }
  static std::vector<MotionObservation> wall() {
    std::vector<MotionObservation> points;
    for (int i = -5; i <= 5; ++i)
      points.push_back({Vector3(0.2 * i, 0.1 * i, kMedianDepth), {0, 0, 0}, {1, 1, 0}});
    points.push_back({Vector3(0, 0, -kMedianDepth), {0, 0, 0}, {1, 1, 0}, false});  // an outlier says nothing
    return points;
  }

  double median_depth_ = kMedianDepth;
  std::vector<MotionObservation> wall_ = wall();
  RedundantLoops loops_{PinholeCamera{400, 400, 320, 240, 640, 480}, {}};
  const SE3 within_{SO3::exp({0, 0.001, 0}), Vector3(0.002, 0, 0)};  // 0.6 px
  const SE3 beyond_{SO3::exp({0, 0.004, 0}), Vector3(0, 0, 0)};      // 1.6 px
};

TEST_F(RedundantLoopTest, ItSaysWhatTheMapSays) {
  const GraphSnapshot near = line(0.2);
  EXPECT_TRUE(redundant(loop(near), near));
  EXPECT_TRUE(redundant(loop(near, within_, 1.005), near));
}

TEST_F(RedundantLoopTest, ItMovesPointsByMoreThanAPixel) {
  const GraphSnapshot near = line(0.2);
  EXPECT_FALSE(redundant(loop(near, beyond_), near));
}

TEST_F(RedundantLoopTest, ItChangesTheScale) {
  const GraphSnapshot near = line(0.2);
  EXPECT_FALSE(redundant(loop(near, SE3(), 1.02), near));
  EXPECT_FALSE(redundant(loop(near, SE3(), 0.98), near));
}

/// The ends of a ring that has not drifted: without the loop they would have nothing to do with each other.
TEST_F(RedundantLoopTest, ItJoinsWhatOnlyALongWayJoins) {
  const GraphSnapshot far = line(1.05 * 4 * kMedianDepth / 5);  // a way of 4.2 depths
  EXPECT_FALSE(redundant(loop(far), far));
  const GraphSnapshot torn = line(0.2, 4);
  EXPECT_FALSE(redundant(loop(torn), torn));
}

/// How far the keyframes are from each other nobody knows then: the loop may tell it.
TEST_F(RedundantLoopTest, AWayPastKeyframesWithoutDepthIsLong) {
  median_depth_ = 0;
  const GraphSnapshot deep = line(0.2);
  EXPECT_FALSE(redundant(loop(deep), deep));
}

/// What a camera saw before it turned has left its view.
TEST_F(RedundantLoopTest, TurnsAreAWayToo) {
  const GraphSnapshot turned = line(0, 5, 0.9);
  EXPECT_FALSE(redundant(loop(turned), turned));
  const GraphSnapshot nodding = line(0, 5, 0.7);
  EXPECT_TRUE(redundant(loop(nodding), nodding));
}

TEST_F(RedundantLoopTest, PointsBehindTheCameraSayNothing) {
  const GraphSnapshot near = line(0.2);
  for (MotionObservation& point : wall_) point.x_ref.z() = -kMedianDepth;
  EXPECT_FALSE(redundant(loop(near), near));
}

TEST_F(RedundantLoopTest, ItRestsOnNothing) {
  const GraphSnapshot near = line(0.2);
  wall_.clear();
  EXPECT_FALSE(redundant(loop(near), near));
}

}  // namespace
}  // namespace twofold
