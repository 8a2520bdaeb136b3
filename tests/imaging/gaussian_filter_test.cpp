#include "imaging/gaussian_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

TEST(GaussianFilter, GivesTheWeightedMeanOfTheNeighbourhood) {
  cv::Mat image(40, 51, CV_8UC1);
  std::minstd_rand random(3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) image.at<std::uint8_t>(v, u) = random() % 256;
  }
  cv::Mat smooth;
  GaussianFilter().apply(image, smooth);
  ASSERT_EQ(smooth.size(), image.size());
  for (int v = GaussianFilter::kBorder; v < image.rows - GaussianFilter::kBorder; ++v) {
    for (int u = GaussianFilter::kBorder; u < image.cols - GaussianFilter::kBorder; ++u) {
      double sum = 0, weights = 0;
      for (int dv = -3; dv <= 3; ++dv) {
        for (int du = -3; du <= 3; ++du) {
          const double w = std::exp(-(du * du + dv * dv) / 8.0);
          sum += w * image.at<std::uint8_t>(v + dv, u + du);
          weights += w;
        }
      }
      ASSERT_NEAR(smooth.at<std::uint8_t>(v, u), sum / weights, 1.5) << u << ", " << v;
    }
  }
}

TEST(GaussianFilter, LeavesAPlainImageAsItIs) {
  for (const int grey : {0, 1, 128, 255}) {
    const cv::Mat image(20, 20, CV_8UC1, cv::Scalar(grey));
    cv::Mat smooth;
    GaussianFilter().apply(image, smooth);
    EXPECT_EQ(smooth.at<std::uint8_t>(10, 10), grey);
    EXPECT_EQ(smooth.at<std::uint8_t>(3, 16), grey);
  }
}

TEST(GaussianFilter, AllocatesNothingForAnImageNoLargerThanOneBefore) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  const cv::Mat large(60, 80, CV_8UC1, cv::Scalar(7)), small(30, 40, CV_8UC1, cv::Scalar(7));
  cv::Mat smooth_large, smooth_small;
  GaussianFilter filter;
  filter.apply(large, smooth_large);
  filter.apply(small, smooth_small);
  const std::uint64_t before = testing::allocations();
  filter.apply(large, smooth_large);
  filter.apply(small, smooth_small);
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace twofold
