#include "imaging/right_rows.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

/// A pair, and what its right image becomes when its rows lie lower.
class RightRowsTest : public ::testing::Test {
 protected:
  RightRowsTest() { testing::RenderedScene(rig_, {3, 2, 5}, 21).render(SE3(), 2, images_); }

  [[nodiscard]] const cv::Mat& left() const { return images_.left.level(0); }
  [[nodiscard]] cv::Mat right(double rows) const {
    cv::Mat moved;
    take_back_row_offset(images_.right.level(0), -rows, moved);
    return moved;
  }
  /// @param rows  that right images lie lower
  /// @return after how many keyframes the offset was another one; 0: never
  int keyframes_until_corrected(double rows, int at_most) {
    const cv::Mat given = right(rows);
    const double before = rows_.offset();
    for (int n = 1; n <= at_most; ++n) {
      rows_.look_at_keyframe(left(), rows_.aligned(given));
      if (rows_.offset() != before) return n;
    }
    return 0;
  }

  const Rig rig_ = testing::test_rig(SensorKind::kStereo, 320, 240);
  FrameImages images_;
  RightRows rows_{rig_, {}};
};

TEST_F(RightRowsTest, ARigThatIsWellStaysAsItIs) {
  const cv::Mat given = right(0);
  EXPECT_FALSE(rows_.look_at_start(left(), given));
  EXPECT_EQ(rows_.offset(), 0);
  EXPECT_EQ(rows_.aligned(given).data, given.data) << "not even a copy";
  EXPECT_EQ(keyframes_until_corrected(0, 40), 0);
}

TEST_F(RightRowsTest, AnOffsetAtTheStartIsTakenBackAtOnce) {
  const cv::Mat given = right(2);
  EXPECT_TRUE(rows_.look_at_start(left(), rows_.aligned(given)));
  EXPECT_NEAR(rows_.offset(), 2, 0.13);
  cv::Mat difference;
  cv::absdiff(rows_.aligned(given).rowRange(4, 236), images_.right.level(0).rowRange(4, 236), difference);
  EXPECT_LT(cv::mean(difference)[0], 3);
  EXPECT_FALSE(rows_.look_at_start(left(), rows_.aligned(given))) << "it is known by now";
}

TEST_F(RightRowsTest, WhatMeasuringCanBeWrongByIsNoOffset) {
  EXPECT_FALSE(rows_.look_at_start(left(), right(0.2)));
  EXPECT_EQ(rows_.offset(), 0);
}

TEST_F(RightRowsTest, TheStartWaitsForAFrameThatShowsSomething) {
  const cv::Mat dark(240, 320, CV_8UC1, cv::Scalar(5));
  for (int n = 0; n < 10; ++n) EXPECT_FALSE(rows_.look_at_start(dark, dark));
  EXPECT_TRUE(rows_.look_at_start(left(), right(-1.5)));
  EXPECT_NEAR(rows_.offset(), -1.5, 0.13);
}

/// One look in eight keyframes, and two of them must agree.
TEST_F(RightRowsTest, AnOffsetThatComesLaterIsTakenBackAtAKeyframe) {
  EXPECT_FALSE(rows_.look_at_start(left(), right(0)));
  EXPECT_EQ(keyframes_until_corrected(1.5, 40), 16);
  EXPECT_NEAR(rows_.offset(), 1.5, 0.13);
  EXPECT_EQ(keyframes_until_corrected(1.5, 40), 0) << "what is left of it is none";
}

TEST_F(RightRowsTest, OneKeyframeOutOfStepChangesNothing) {
  (void)rows_.look_at_start(left(), right(0));
  const cv::Mat given = right(0), out_of_step = right(1.5);
  for (int n = 1; n <= 32; ++n) rows_.look_at_keyframe(left(), n == 16 ? out_of_step : given);
  EXPECT_EQ(rows_.offset(), 0);
}

TEST_F(RightRowsTest, AThoroughSearchIsMadeSeldom) {
  (void)rows_.look_at_start(left(), right(0));
  ASSERT_EQ(keyframes_until_corrected(1.5, 40), 16);
  EXPECT_GE(keyframes_until_corrected(3, 200), 64) << "it costs several milliseconds";
  EXPECT_NEAR(rows_.offset(), 3, 0.13);
}

}  // namespace
}  // namespace twofold
