#include "tracking/monocular/corner_following.hpp"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "imaging/patch.hpp"

namespace twofold {
namespace {

constexpr int kWidth = 620, kHeight = 188;  // wide and low: half of KITTI's images

/// Follows corners all over the image into one that shows all `shift` px farther.
class CornerFollowingTest : public ::testing::Test {
 protected:
  CornerFollowingTest() {
    cv::Mat noise(kHeight + 200, kWidth + 200, CV_32F);
    cv::theRNG().state = 3;
    cv::randu(noise, 0, 255);
    cv::Mat fine, coarse;
    cv::GaussianBlur(noise, fine, {}, 2);
    cv::GaussianBlur(noise, coarse, {}, 10);
    cv::Mat(128 + 4 * (fine - 127.5) + 20 * (coarse - 127.5)).convertTo(ground_, CV_8U);
  }
  void expect_followed(const cv::Point& shift, const std::optional<Eigen::Vector2f>& motion) {
    constexpr int kRim = 16;  // of the patch around a corner
    const cv::Rect before(100, 100, kWidth, kHeight);
    ImagePyramid previous, current;
    previous.build(ground_(before));
    current.build(ground_(before - shift));
    for (int v = kRim; v < kHeight - kRim; v += 12) {
      for (int u = kRim; u < kWidth - kRim; u += 24) {
        const cv::Point to = cv::Point(u, v) + shift;
        if (!cv::Rect(kRim, kRim, kWidth - 2 * kRim, kHeight - 2 * kRim).contains(to)) continue;
        FollowedCorner corner{{}, Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v)), motion};
        ASSERT_TRUE(cut_appearance(previous.level(0), u, v, 0, corner.appearance));
        ++asked_;
        if (!follow_corner(previous, current, {}, corner)) continue;
        const Eigen::Vector2f expected(static_cast<float>(to.x), static_cast<float>(to.y));
        if ((corner.uv - expected).norm() < 0.5F) ++found_;
      }
    }
  }

  cv::Mat ground_;
  int asked_ = 0, found_ = 0;
};

/// Forward motion is largest near the border, where no patch of the coarsest level has room.
TEST_F(CornerFollowingTest, FollowsUpToTheBorderOfALowImage) {
  for (const cv::Point shift : {cv::Point(0, 24), {0, -24}, {24, 0}, {-24, 8}})
    expect_followed(shift, std::nullopt);
  // Of places on a grid, not all of which are corners: 1132 of 1174.
  EXPECT_GT(found_, 0.95 * asked_) << asked_;
}

TEST_F(CornerFollowingTest, LooksLessFarWhereTheMotionIsKnown) {
  expect_followed({40, -10}, Eigen::Vector2f(28, 0));
  EXPECT_GT(found_, 0.97 * asked_) << asked_;
  const int with_motion = found_;
  expect_followed({100, 0}, Eigen::Vector2f(28, 0));
  EXPECT_LT(found_ - with_motion, 0.1 * asked_) << "72 px from where it should be";
}

TEST(CornerFollowing, WhatRepeatsStandsStillWhereItMay) {
  cv::Mat board(120, 160, CV_8UC1);
  for (int v = 0; v < board.rows; ++v)
    for (int u = 0; u < board.cols; ++u) board.at<std::uint8_t>(v, u) = (u / 7 + v / 5) % 2 == 0 ? 60 : 180;
  ImagePyramid images;
  images.build(board);
  FollowedCorner corner{{}, {77, 60}, std::nullopt};
  ASSERT_TRUE(cut_appearance(images.level(0), 77, 60, 0, corner.appearance));
  ASSERT_TRUE(follow_corner(images, images, {}, corner));
  EXPECT_LT((corner.uv - Eigen::Vector2f(77, 60)).norm(), 0.1F);
}

}  // namespace
}  // namespace twofold
