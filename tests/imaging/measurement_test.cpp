// What a measurement is made of besides the search: its right coordinate and its information.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

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

TEST(RightFromDepth, IsOfTheMedianOfWhatIsMeasured) {
  const Rig rig = test_rig(SensorKind::kRgbd);
  cv::Mat depth(3, 3, CV_16UC1);
  std::mt19937 rng(4);
  std::uniform_int_distribution<int> reading(1990, 2010), hole(0, 4);
  int refused = 0;
  for (int i = 0; i < 500; ++i) {
    std::vector<std::uint16_t> measured;
    for (auto pixel = depth.begin<std::uint16_t>(); pixel != depth.end<std::uint16_t>(); ++pixel) {
      *pixel = hole(rng) == 0 ? 0 : static_cast<std::uint16_t>(reading(rng));
      if (*pixel != 0) measured.push_back(*pixel);
    }
    const double found = right_from_depth(depth, rig, 1, 1);
    if (measured.size() < 5) {
      EXPECT_TRUE(std::isnan(found));
      ++refused;
      continue;
    }
    std::sort(measured.begin(), measured.end());
    const double median = measured[measured.size() / 2] * rig.depth_unit;
    EXPECT_NEAR(found, 1 - rig.disparity_from_depth(median), 1e-9);
  }
  EXPECT_GT(refused, 5);
}

}  // namespace
}  // namespace twofold
