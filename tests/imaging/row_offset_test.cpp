#include "imaging/row_offset.hpp"

#include <gtest/gtest.h>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

FrameImages view() {
  testing::RenderedScene scene(testing::test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 21);
  FrameImages images;
  scene.render(SE3(), 2, images);
  return images;
}

TEST(RowOffset, IsMeasuredToAFractionOfARow) {
  const FrameImages images = view();
  const cv::Mat& left = images.left.level(0);
  RowOffsetMeter meter(testing::test_rig(SensorKind::kStereo, 320, 240), 160);
  for (const double offset : {-4.0, -2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.75, 2.0, 3.0}) {
    cv::Mat shifted;
    take_back_row_offset(images.right.level(0), -offset, shifted);
    const auto found = meter.search(left, shifted);
    ASSERT_TRUE(found) << offset;
    EXPECT_NEAR(found->rows, offset, 0.1);
    EXPECT_GT(found->matches, 30) << offset;
  }
}

TEST(RowOffset, IsTakenBack) {
  cv::Mat ramp(12, 20, CV_8UC1), lower;
  for (int v = 0; v < ramp.rows; ++v) ramp.row(v) = cv::Scalar(10 * v);
  take_back_row_offset(ramp, 1.5, lower);
  for (int v = 0; v + 2 < ramp.rows; ++v) EXPECT_EQ(lower.at<std::uint8_t>(v, 7), 10 * v + 15) << v;
  EXPECT_EQ(lower.at<std::uint8_t>(11, 7), 110);
}

TEST(RowOffset, IsNotInventedWhereNothingMatches) {
  const FrameImages images = view();
  RowOffsetMeter meter(testing::test_rig(SensorKind::kStereo, 320, 240), 160);
  EXPECT_FALSE(meter.search(images.left.level(0), cv::Mat(240, 320, CV_8UC1, cv::Scalar(90))));
  testing::RenderedScene other(testing::test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 1234);
  FrameImages elsewhere;
  other.render(SE3(), 2, elsewhere);
  const auto found = meter.search(images.left.level(0), elsewhere.right.level(0));
  EXPECT_FALSE(found) << found->rows << " at " << found->matches;
}

}  // namespace
}  // namespace twofold
