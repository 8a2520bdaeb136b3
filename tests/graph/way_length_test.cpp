#include "graph/way_length.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

Keyframe of_depth(double median_depth) {
  Keyframe keyframe;
  keyframe.median_depth = median_depth;
  return keyframe;
}

TEST(WayLength, CountsMeanDepthsAndRadians) {
  const SE3 T_to_from(SO3::exp({0, 0.4, 0}), {0, 3, 0});
  EXPECT_NEAR(way_length(of_depth(2), of_depth(4), T_to_from), 1.4, 1e-12);
  EXPECT_NEAR(way_length(of_depth(4), of_depth(2), T_to_from.inverse()), 1.4, 1e-12);
}

TEST(WayLength, DoesNotDependOnTheUnit) {
  const SE3 T_to_from(SO3::exp({0, 0.4, 0}), {0, 3, 0}), ten_times(T_to_from.so3(), {0, 30, 0});
  EXPECT_NEAR(way_length(of_depth(2), of_depth(4), T_to_from),
              way_length(of_depth(20), of_depth(40), ten_times), 1e-12);
}

TEST(WayLength, IsLongWhereNobodyKnowsTheDepth) {
  EXPECT_GT(way_length(of_depth(0), of_depth(0), SE3(SO3(), {0.001, 0, 0})), kWayOfOneUnit);
  EXPECT_EQ(way_length(of_depth(0), of_depth(0), SE3()), 0);
}

}  // namespace
}  // namespace twofold
