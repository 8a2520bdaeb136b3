#include "synthetic/image_effects.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

namespace twofold::synthetic {
namespace {

TEST(Expose, NoiseHasTheStatedMeanAndDeviation) {
  const cv::Mat grey(480, 640, CV_32FC1, cv::Scalar(100.3));
  const cv::Mat image = expose(grey, 1.2, 3.0, {5, 7});
  double sum = 0;
  double square = 0;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double d = image.at<std::uint8_t>(y, x) - 1.2 * 100.3;
      sum += d;
      square += d * d;
    }
  }
  const auto n = static_cast<double>(image.total());
  EXPECT_NEAR(sum / n, 0, 5 * 3.0 / std::sqrt(n));
  // Rounding adds the variance of a uniform number, 1/12.
  EXPECT_NEAR(std::sqrt(square / n), std::sqrt(9.0 + 1.0 / 12), 0.02);
}

TEST(Expose, NoiseIsUncorrelatedBetweenNeighboursAndImages) {
  const cv::Mat grey(480, 640, CV_32FC1, cv::Scalar(128));
  const cv::Mat a = expose(grey, 1, 4, {1, 1});
  const cv::Mat b = expose(grey, 1, 4, {1, 2});
  double along = 0;
  double across = 0;
  double between = 0;
  for (int y = 0; y + 1 < a.rows; ++y) {
    for (int x = 0; x + 1 < a.cols; ++x) {
      const double d = a.at<std::uint8_t>(y, x) - 128.0;
      along += d * (a.at<std::uint8_t>(y, x + 1) - 128.0);
      across += d * (a.at<std::uint8_t>(y + 1, x) - 128.0);
      between += d * (b.at<std::uint8_t>(y, x) - 128.0);
    }
  }
  const auto n = static_cast<double>(a.total());
  const double five_sigma = 5 / std::sqrt(n);
  EXPECT_LT(std::abs(along / n / 16), five_sigma);
  EXPECT_LT(std::abs(across / n / 16), five_sigma);
  EXPECT_LT(std::abs(between / n / 16), five_sigma);
}

TEST(Expose, WithoutNoiseRoundsToNearestAndClips) {
  const cv::Mat values = (cv::Mat_<float>(1, 4) << -3.0f, 10.4f, 10.6f, 400.0f);
  const cv::Mat image = expose(values, 1, 0, {1, 1});
  EXPECT_EQ(image.at<std::uint8_t>(0, 0), 0);
  EXPECT_EQ(image.at<std::uint8_t>(0, 1), 10);
  EXPECT_EQ(image.at<std::uint8_t>(0, 2), 11);
  EXPECT_EQ(image.at<std::uint8_t>(0, 3), 255);
}

TEST(SenseDepth, NoiseGrowsWithTheSquareOfTheDepth) {
  Rig rig;
  rig.camera = {420, 420, 319.5, 239.5, 640, 480};
  for (const double z : {1.0, 2.0, 4.0}) {
    const cv::Mat flat(480, 640, CV_32FC1, cv::Scalar(1 / z));
    const cv::Mat depth = sense_depth(flat, rig, 1, {3, 4});
    double square = 0;
    int count = 0;
    for (int y = 0; y < depth.rows; ++y) {
      for (int x = 0; x < depth.cols; ++x) {
        if (depth.at<std::uint16_t>(y, x) == 0) continue;
        const double d = depth.at<std::uint16_t>(y, x) * rig.depth_unit - z;
        square += d * d;
        ++count;
      }
    }
    const double quantisation = rig.depth_unit * rig.depth_unit / 12;
    const double expected = std::sqrt(std::pow(1.425e-3 * z * z, 2) + quantisation);
    EXPECT_NEAR(std::sqrt(square / count), expected, 0.02 * expected) << z;
    EXPECT_GT(count, 0.98 * 640 * 480);  // a few spots are holes
    EXPECT_LT(count, 640 * 480);
  }
}

TEST(SenseDepth, HolesOutOfRangeAndAtJumps) {
  Rig rig;
  rig.camera = {420, 420, 319.5, 239.5, 640, 480};
  cv::Mat inverse_depth(480, 640, CV_32FC1, cv::Scalar(0.5));
  inverse_depth.colRange(320, 640).setTo(1.0);  // 2 m beside 1 m
  inverse_depth.rowRange(0, 20).setTo(0);       // sky
  inverse_depth.rowRange(20, 40).setTo(1 / 8.5);
  inverse_depth.rowRange(40, 60).setTo(1 / 0.2);
  const cv::Mat depth = sense_depth(inverse_depth, rig, 0, {3, 4});
  EXPECT_EQ(cv::countNonZero(depth.rowRange(0, 60)), 0);
  EXPECT_EQ(cv::countNonZero(depth(cv::Rect(319, 100, 2, 300))), 0);
  EXPECT_GT(cv::countNonZero(depth(cv::Rect(322, 100, 300, 300))), 0.98 * 300 * 300);
  for (int x = 322; x < 640; ++x) {
    const int reading = depth.at<std::uint16_t>(200, x);
    EXPECT_TRUE(reading == 0 || reading == 1000) << reading;
  }
}

}  // namespace
}  // namespace twofold::synthetic
