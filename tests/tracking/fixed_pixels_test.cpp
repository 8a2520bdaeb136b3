#include "tracking/fixed/fixed_pixels.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "synthetic/random.hpp"

namespace twofold {
namespace {

constexpr int kWidth = 240, kHeight = 176;
constexpr int kStepPx = 11;                      // of the scene between two frames, to the left
constexpr std::int64_t kFrame_ns = 300'000'000;  // so long that all of each image is looked at
const PinholeCamera kCamera{200, 200, 119.5, 87.5, kWidth, kHeight};

/// Squares of 5 px, each of its own brightness.
std::uint8_t squares_at(int u, int v, std::uint64_t seed) {
  const auto key = static_cast<std::uint64_t>(v / 5 * 10'000 + u / 5);
  return static_cast<std::uint8_t>(20 + synthetic::mix64(key + seed) % 200);
}

cv::Mat scene(int moved_px) {
  cv::Mat image(kHeight, kWidth, CV_8UC1);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) image.at<std::uint8_t>(v, u) = squares_at(u + moved_px, v, 1);
  }
  return image;
}

/// Rows from `top` on move with the camera.
void show_bonnet(cv::Mat& image, int top) {
  for (int v = top; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) image.at<std::uint8_t>(v, u) = squares_at(u, v, 2);
  }
}

/// The camera turns to the right so far that the scene moves by kStepPx, where the image's middle is.
SE3 turn() {
  return {SO3::exp(Vector3(0, -std::atan(kStepPx / kCamera.fx), 0)), Vector3::Zero()};
}

class FixedPixelsTest : public ::testing::Test {
 protected:
  FixedPixelsTest() { motion_.set_inverse_depths(0.1, 1); }

  void look_at(const cv::Mat& image, const SE3& T_now_before) {
    motion_.advance(T_now_before);
    fixed_.look_at(image, t_ns_ += kFrame_ns, motion_);
  }
  /// Share of the pixels in these rows that are covered.
  [[nodiscard]] double covered(int top, int bottom) const {
    int count = 0;
    for (int v = top; v < bottom; ++v) {
      for (int u = 0; u < kWidth; ++u) count += fixed_.covers({u, v}) ? 1 : 0;
    }
    return static_cast<double>(count) / (kWidth * (bottom - top));
  }
  [[nodiscard]] int touched(int top, int bottom) const {
    int count = 0;
    for (int v = top; v < bottom; ++v) {
      for (int u = 0; u < kWidth; ++u)
        count += fixed_.touches({static_cast<float>(u), static_cast<float>(v)}, 0) ? 1 : 0;
    }
    return count;
  }

  FixedPixelOptions options_{.max_fixed_share = 1};
  std::int64_t t_ns_ = 0;
  ImageMotion motion_{kCamera};
  FixedPixels fixed_{kWidth, kHeight, options_};
};

TEST_F(FixedPixelsTest, ABonnetIsCoveredAndTheSceneIsNot) {
  for (int i = 0; i < 12; ++i) {
    cv::Mat image = scene(i * kStepPx);
    show_bonnet(image, 132);
    look_at(image, turn());
    EXPECT_TRUE(i >= options_.believed || covered(0, kHeight) == 0) << i;
  }
  EXPECT_GT(covered(136, 172), 0.9);
  EXPECT_EQ(covered(0, 116), 0);
  EXPECT_GT(touched(136, 168), 20 * kWidth);
  EXPECT_EQ(touched(0, 120), 0);
  EXPECT_TRUE(fixed_.touches({100, 150}, 2)) << "a patch of a coarser level";
  EXPECT_TRUE(fixed_.dead().empty());
}

TEST_F(FixedPixelsTest, WhatHasGoneIsForgotten) {
  for (int i = 0; i < 12; ++i) {
    cv::Mat image = scene(i * kStepPx);
    show_bonnet(image, 132);
    look_at(image, turn());
  }
  ASSERT_GT(covered(136, 172), 0.9);
  for (int i = 12; i < 17; ++i) look_at(scene(i * kStepPx), turn());
  EXPECT_EQ(covered(0, kHeight), 0);
  EXPECT_EQ(touched(0, kHeight), 0);
}

TEST_F(FixedPixelsTest, DeadPixelsAreListed) {
  std::vector<cv::Point> dead;
  for (int i = 0; i < 20; ++i) dead.emplace_back(10 + 11 * i, 12 + 37 * i % 150);
  for (int i = 0; i < 12; ++i) {
    cv::Mat image = scene(i * kStepPx);
    for (const cv::Point& at : dead) image.at<std::uint8_t>(at) = at.x % 2 == 0 ? 0 : 255;
    look_at(image, turn());
  }
  const auto listed = fixed_.dead();
  for (const cv::Point& at : dead) EXPECT_NE(std::find(listed.begin(), listed.end(), at), listed.end()) << at;
  EXPECT_LE(listed.size(), 2 * dead.size()) << "of blocks that overlap, some twice";
  EXPECT_EQ(covered(0, kHeight), 0);
}

TEST_F(FixedPixelsTest, ACameraAtRestSaysNothing) {
  for (int i = 0; i < 200; ++i) look_at(scene(0), SE3());
  EXPECT_EQ(covered(0, kHeight), 0);
  EXPECT_EQ(touched(0, kHeight), 0);
}

/// What a camera goes around stays where it is in the image, because its depth makes it so.
TEST_F(FixedPixelsTest, WhatTheCameraGoesAroundIsNotFixed) {
  const double angle = std::atan(kStepPx / kCamera.fx), depth = 2;
  const SE3 around(SO3::exp(Vector3(0, -angle, 0)), depth * Vector3(std::sin(angle), 0, 1 - std::cos(angle)));
  ASSERT_LT((around * Vector3(0, 0, depth) - Vector3(0, 0, depth)).norm(), 1e-9);
  for (int i = 0; i < 30; ++i) look_at(scene(0), around);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 100; u < 140; ++u)
      ASSERT_FALSE(fixed_.touches({static_cast<float>(u), static_cast<float>(v)}, 0)) << u << ", " << v;
  }
}

/// Straight on: what lies ahead stays where it is.
TEST_F(FixedPixelsTest, WhereTheCameraIsHeadingIsNotFixed) {
  for (int i = 0; i < 40; ++i) look_at(scene(0), {SO3(), Vector3(0, 0, -0.2)});
  for (int u = 104; u < 136; ++u) EXPECT_FALSE(fixed_.touches({static_cast<float>(u), 88}, 0)) << u;
  EXPECT_TRUE(fixed_.touches({40, 160}, 0)) << "at the edge, the scene should have moved";
}

TEST_F(FixedPixelsTest, NothingIsBelievedWhenAllSeemsFixed) {
  fixed_ = FixedPixels(kWidth, kHeight, {});
  for (int i = 0; i < 12; ++i) {
    cv::Mat image = scene(i * kStepPx);
    show_bonnet(image, 0);
    look_at(image, turn());
  }
  EXPECT_EQ(covered(0, kHeight), 0);
  EXPECT_EQ(touched(0, kHeight), 0);
}

TEST_F(FixedPixelsTest, AWayThatIsNotKnownSaysNothing) {
  for (int i = 0; i < 40; ++i) {
    motion_.restart();
    cv::Mat image = scene(i * kStepPx);
    show_bonnet(image, 132);
    fixed_.look_at(image, t_ns_ += kFrame_ns, motion_);
  }
  EXPECT_EQ(covered(0, kHeight), 0);
}

TEST(ImageMotion, KnowsTheLeastDisplacementOverAllDepths) {
  ImageMotion motion(kCamera);
  motion.set_inverse_depths(0.1, 1);
  const Vector2 uv(60, 50);
  const std::int64_t then = motion.frame();
  const SE3 step(SO3::exp(Vector3(0.004, -0.01, 0.003)), Vector3(-0.05, 0.01, 0.03));
  for (int i = 0; i < 3; ++i) motion.advance(step);
  const auto least = motion.least_since(then, uv);
  ASSERT_TRUE(least);
  double shortest = 1e9;
  for (double inverse_depth = 0.1; inverse_depth <= 1; inverse_depth += 1e-3) {
    const Vector3 x = kCamera.unproject(uv) / inverse_depth;
    shortest = std::min(shortest, (kCamera.project(step * (step * (step * x))) - uv).norm());
  }
  EXPECT_NEAR(least->norm(), shortest, 1e-2);
  for (int i = 0; i < ImageMotion::kRemembered; ++i) motion.advance(step);
  EXPECT_FALSE(motion.least_since(then, uv)) << "too long ago";
}

}  // namespace
}  // namespace twofold
