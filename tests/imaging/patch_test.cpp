#include "imaging/patch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "imaging/image_pyramid.hpp"

namespace twofold {
namespace {

/// Band-limited picture that can be sampled anywhere.
double wave(double u, double v) {
  return 120 + 45 * std::sin(0.55 * u + 0.2 * v) + 40 * std::sin(0.15 * u - 0.6 * v + 1) +
         20 * std::sin(0.31 * (u + v));
}

cv::Mat picture(double du, double dv, double gain = 1, double offset = 0) {
  cv::Mat image(64, 96, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(std::clamp(gain * wave(u - du, v - dv) + offset + 0.5, 0.0, 255.0));
    }
  }
  return image;
}

TEST(ImagePyramid, AveragesBlocksAtEverySize) {
  std::mt19937 random(1);
  for (const int width : {127, 128, 200, 81}) {
    cv::Mat image(67, width, CV_8UC1);
    for (int i = 0; i < image.rows * image.cols; ++i) image.data[i] = static_cast<std::uint8_t>(random());
    ImagePyramid pyramid;
    pyramid.build(image);
    for (int l = 1; l < ImagePyramid::kLevels; ++l) {
      const cv::Mat& fine = pyramid.level(l - 1);
      const cv::Mat& coarse = pyramid.level(l);
      ASSERT_EQ(coarse.cols, fine.cols / 2);
      ASSERT_EQ(coarse.rows, fine.rows / 2);
      for (int v = 0; v < coarse.rows; ++v) {
        for (int u = 0; u < coarse.cols; ++u) {
          const int sum = fine.at<std::uint8_t>(2 * v, 2 * u) + fine.at<std::uint8_t>(2 * v, 2 * u + 1) +
                          fine.at<std::uint8_t>(2 * v + 1, 2 * u) +
                          fine.at<std::uint8_t>(2 * v + 1, 2 * u + 1);
          ASSERT_EQ(coarse.at<std::uint8_t>(v, u), (sum + 2) / 4);
        }
      }
    }
  }
}

TEST(Patch, CutAndIdentityWarpAgree) {
  const cv::Mat image = picture(0, 0);
  PointAppearance appearance;
  ASSERT_TRUE(cut_appearance(image, 40, 30, 0, appearance));
  Patch cut, warped;
  ASSERT_TRUE(cut_patch(image, 40, 30, cut));
  warp_patch(appearance, Eigen::Matrix2d::Identity(), 0, warped);
  for (int i = 0; i < Patch::kArea; ++i) {
    EXPECT_NEAR(cut.value[i], warped.value[i], 1e-3);
    EXPECT_NEAR(cut.gradient_u[i], warped.gradient_u[i], 1e-3);
    EXPECT_NEAR(cut.gradient_v[i], warped.gradient_v[i], 1e-3);
    EXPECT_EQ(cut.rounded[i],
              image.at<std::uint8_t>(30 + i / 8 - Patch::kCentre, 40 + i % 8 - Patch::kCentre));
  }
  EXPECT_FALSE(cut_patch(image, 4, 30, cut));
  EXPECT_FALSE(cut_appearance(image, 40, 60, 0, appearance));
}

TEST(Patch, ZeroMeanSsdIsThatOfTheDefinition) {
  std::mt19937 random(5);
  cv::Mat image(32, 32, CV_8UC1);
  for (int i = 0; i < image.rows * image.cols; ++i) image.data[i] = static_cast<std::uint8_t>(random());
  Patch patch;
  ASSERT_TRUE(cut_patch(image, 12, 13, patch));
  EXPECT_EQ(zero_mean_ssd(patch, image, 12, 13), 0);
  for (int trial = 0; trial < 50; ++trial) {
    const int u = 4 + static_cast<int>(random() % 24);
    const int v = 4 + static_cast<int>(random() % 24);
    double sum = 0, sum2 = 0;
    for (int i = 0; i < Patch::kArea; ++i) {
      const double d = image.at<std::uint8_t>(v + i / 8 - 4, u + i % 8 - 4) - patch.rounded[i];
      sum += d;
      sum2 += d * d;
    }
    EXPECT_NEAR(zero_mean_ssd(patch, image, u, v), sum2 - sum * sum / 64, 1.0);
  }
}

TEST(Patch, RowOfSsdsIsThatOfSingleOnes) {
  std::mt19937 random(6);
  cv::Mat image(24, 90, CV_8UC1);
  for (int i = 0; i < image.rows * image.cols; ++i) image.data[i] = static_cast<std::uint8_t>(random());
  Patch patch;
  ASSERT_TRUE(cut_patch(image, 40, 12, patch));
  for (const int count : {1, 7, 8, 9, 15, 16, 61, 74}) {
    std::vector<int> cost(static_cast<std::size_t>(count));
    zero_mean_ssd_row(patch, image, 8, 11, cost);
    for (int i = 0; i < count; ++i) {
      EXPECT_EQ(cost[static_cast<std::size_t>(i)], zero_mean_ssd(patch, image, 8 + i, 11))
          << count << ' ' << i;
    }
  }
}

TEST(Patch, AlignmentRecoversShiftGainAndOffset) {
  Patch patch;
  ASSERT_TRUE(cut_patch(picture(0, 0), 40, 30, patch));
  std::mt19937 random(9);
  std::uniform_real_distribution<double> shift(-1.4, 1.4);
  for (int trial = 0; trial < 40; ++trial) {
    const double du = shift(random);
    const double dv = shift(random);
    const cv::Mat image = picture(du, dv, 0.75, 20);
    const auto aligned = align_patch(patch, image, {40, 30}, 15);
    ASSERT_TRUE(aligned) << du << " " << dv;
    EXPECT_NEAR(aligned->uv.x(), 40 + du, 0.04);
    EXPECT_NEAR(aligned->uv.y(), 30 + dv, 0.04);
    EXPECT_LT(aligned->rms, 3.0F);
  }
}

TEST(Patch, RowAlignmentKeepsTheRow) {
  Patch patch;
  ASSERT_TRUE(cut_patch(picture(0, 0), 40, 30, patch));
  const auto aligned = align_patch_in_row(patch, picture(0.8, 0), {40, 30}, 15);
  ASSERT_TRUE(aligned);
  EXPECT_NEAR(aligned->uv.x(), 40.8, 0.03);
  EXPECT_EQ(aligned->uv.y(), 30);
}

TEST(Patch, AlignmentGivesUpOutsideAndOnFlatImages) {
  Patch patch;
  ASSERT_TRUE(cut_patch(picture(0, 0), 40, 30, patch));
  EXPECT_FALSE(align_patch(patch, picture(0, 0), {3, 3}, 15));
  const cv::Mat flat(64, 96, CV_8UC1, cv::Scalar(100));
  EXPECT_FALSE(align_patch(patch, flat, {40, 30}, 15));
}

TEST(Patch, WarpOfASurfaceParallelToTheImageIsExact) {
  const PinholeCamera camera{300, 310, 160, 120, 320, 240};
  const Vector3 psi(0.2, -0.1, 0.5);  // 2 m away
  const SE3 T_c_a = SE3::exp((Vector6() << 0.1, -0.05, 0.3, 0.1, -0.08, 0.2).finished());
  const auto warp = predict_warp(camera, psi, T_c_a);
  ASSERT_TRUE(warp);
  const double depth = 1 / psi.z();
  const Vector3 x_a = Vector3(psi.x(), psi.y(), 1) * depth;
  EXPECT_LT((warp->uv - camera.project(T_c_a * x_a)).norm(), 1e-9);
  EXPECT_NEAR(warp->depth, (T_c_a * x_a).z(), 1e-12);
  const double h = 1e-5;  // pixels of the anchor
  for (int axis = 0; axis < 2; ++axis) {
    Vector3 step = Vector3::Zero();
    step[axis] = h * depth / (axis == 0 ? camera.fx : camera.fy);
    const Vector2 numeric =
        (camera.project(T_c_a * (x_a + step)) - camera.project(T_c_a * (x_a - step))) / (2 * h);
    EXPECT_LT((numeric - warp->A_c_a.col(axis)).norm(), 1e-6);
  }
  EXPECT_FALSE(predict_warp(camera, psi, SE3(SO3(), Vector3(0, 0, -3))));
}

TEST(Patch, SearchLevelFollowsTheScale) {
  const auto at = [](double scale, int level) {
    return search_level(Eigen::Matrix2d::Identity() * scale, level);
  };
  EXPECT_EQ(at(1, 0), 0);
  EXPECT_EQ(at(1, 2), 2);
  EXPECT_EQ(at(2, 0), 1);
  EXPECT_EQ(at(0.5, 2), 1);
  EXPECT_EQ(at(0.6, 0), 0);
  EXPECT_FALSE(at(0.2, 0));  // smaller than the finest level shows
  EXPECT_FALSE(at(32, 0));
  EXPECT_FALSE(search_level(Eigen::Matrix2d(Eigen::Vector2d(1, -1).asDiagonal()), 0));  // mirrored
}

}  // namespace
}  // namespace twofold
