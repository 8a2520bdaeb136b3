// What a measurement is made of besides the search: its right coordinate and its information.
#include <gtest/gtest.h>

#include <cmath>

#include "fixtures/rendered_scene.hpp"
#include "imaging/guided_search.hpp"

namespace twofold {
namespace {

using testing::test_rig;

TEST(RightFromDepth, IsTheVirtualDisparityAndRefusesHolesAndEdges) {
  const Rig rig = test_rig(SensorKind::kRgbd);
  cv::Mat depth(rig.camera.height, rig.camera.width, CV_16UC1, cv::Scalar(2000));
  EXPECT_NEAR(right_from_depth(depth, rig, 100.25, 50.5), 100.25 - rig.disparity_from_depth(2.0), 1e-9);
  depth(cv::Rect(200, 0, 100, 100)) = 0;
  EXPECT_TRUE(std::isnan(right_from_depth(depth, rig, 250, 50)));  // hole
  depth(cv::Rect(300, 0, 100, 100)) = 1000;
  EXPECT_TRUE(std::isnan(right_from_depth(depth, rig, 400, 50)));  // edge between 1 m and 2 m
  depth(cv::Rect(0, 200, 50, 50)) = 65000;
  EXPECT_TRUE(std::isnan(right_from_depth(depth, rig, 20, 220)));  // beyond the sensor's range
  EXPECT_TRUE(std::isnan(right_from_depth(depth, rig, 0, 220)));   // rim
}

}  // namespace
}  // namespace twofold
