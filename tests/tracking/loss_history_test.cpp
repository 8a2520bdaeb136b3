#include "tracking/loss/loss_history.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

ImagePyramid pyramid_of(const cv::Mat& image) {
  ImagePyramid pyramid;
  pyramid.build(image);
  return pyramid;
}

class LostCauseTest : public ::testing::Test {
 protected:
  static cv::Mat view(double turned) {
    RenderedScene scene(test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 21);
    return scene.render_one(SE3(SO3::exp(Vector3(0, turned, 0)), Vector3::Zero()), 2);
  }
  static LostCause explain(const cv::Mat& now, LostCause found = LostCause::kTooFewMatches,
                           LostCause gap = LostCause::kNone) {
    return explain_loss(found, pyramid_of(now), pyramid_of(view(0)), gap, {});
  }
};

TEST_F(LostCauseTest, AnotherViewIsNeitherBlurredNorCovered) {
  for (const double turned : {0.0, 0.05, 0.4, 0.8, 1.2, 2.0, 3.0}) {
    EXPECT_EQ(explain(view(turned)), LostCause::kTooFewMatches) << turned;
    EXPECT_EQ(explain(view(turned), LostCause::kInconsistentMatches), LostCause::kInconsistentMatches);
  }
}

TEST_F(LostCauseTest, MotionBlurTakesTheDetail) {
  for (const double turned : {0.0, 0.4, 1.2}) {
    cv::Mat blurred;
    cv::blur(view(turned), blurred, cv::Size(15, 1));
    EXPECT_EQ(explain(blurred), LostCause::kBlurred) << turned;
    EXPECT_EQ(explain(blurred, LostCause::kTooFewMatches, LostCause::kGapInTime), LostCause::kBlurred);
  }
}

TEST_F(LostCauseTest, AHandOrDarknessTakesTheContrast) {
  cv::Mat dark = view(0.2) / 12;
  EXPECT_EQ(explain(dark), LostCause::kCovered);
  cv::Mat hand(240, 320, CV_8UC1, cv::Scalar(60));
  cv::randn(hand, 60, 2);
  EXPECT_EQ(explain(hand), LostCause::kCovered);
}

TEST_F(LostCauseTest, WhatIsKnownBetterStays) {
  cv::Mat blurred;
  cv::blur(view(0), blurred, cv::Size(25, 1));
  EXPECT_EQ(explain(blurred, LostCause::kNoKeyframeBuffer), LostCause::kNoKeyframeBuffer);
  EXPECT_EQ(explain(blurred, LostCause::kUnplaced), LostCause::kUnplaced);
  EXPECT_EQ(explain_loss(LostCause::kTooFewMatches, pyramid_of(blurred), {}, LostCause::kNone, {}),
            LostCause::kTooFewMatches);
}

TEST(FrameIntervals, TellMissingFramesFromGapsInTime) {
  constexpr std::int64_t kMs = 1'000'000;
  FrameIntervals intervals(LossSignOptions{}.gap_intervals);
  EXPECT_EQ(intervals.next(0, 5 * kMs), LostCause::kNone);
  EXPECT_EQ(intervals.next(1, 38 * kMs), LostCause::kNone);
  EXPECT_EQ(intervals.next(2, 75 * kMs), LostCause::kNone);
  EXPECT_EQ(intervals.next(3, 108 * kMs), LostCause::kNone);
  EXPECT_EQ(intervals.next(4, 300 * kMs), LostCause::kGapInTime);
  EXPECT_EQ(intervals.next(5, 333 * kMs), LostCause::kNone);
  EXPECT_EQ(intervals.next(9, 466 * kMs), LostCause::kFramesMissing);
}

TEST(FrameIntervals, TwoFramesThatComeTogetherMakeNoGapsOfTheOthers) {
  FrameIntervals intervals(LossSignOptions{}.gap_intervals);
  std::int64_t t_ns = 0;
  for (int i = 0; i < 40; ++i) {
    t_ns += i == 10 ? 2'000'000 : 33'000'000;
    EXPECT_EQ(intervals.next(i, t_ns), LostCause::kNone) << i;
  }
}

}  // namespace
}  // namespace twofold
