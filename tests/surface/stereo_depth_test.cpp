#include "surface/stereo/stereo_depth.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

Rig small_rig() {
  Rig rig;
  rig.kind = SensorKind::kStereo;
  rig.camera = {256, 256, 159.5, 119.5, 320, 240};
  rig.baseline = 0.1;
  return rig;
}

cv::Mat random_texture(int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  cv::Mat image(240, 320, CV_8UC1);
  for (int i = 0; i < static_cast<int>(image.total()); ++i)
    image.at<std::uint8_t>(i) = static_cast<std::uint8_t>(random() % 256);
  return image;
}

TEST(StereoDepth, FindsTheDistanceOfAWall) {
  const Rig rig = small_rig();
  const cv::Mat left = random_texture(4);
  const int disparity = 16;  // z = 256 * 0.1 / 16 = 1.6 m
  cv::Mat right(left.size(), CV_8UC1, cv::Scalar(0));
  left.colRange(disparity, 320).copyTo(right.colRange(0, 320 - disparity));
  const cv::Mat depth = stereo_depth(rig, left, right, 0.5);
  int found = 0, left_rim = 0;
  for (int y = 40; y < 200; ++y) {
    for (int x = 100; x < 280; ++x) found += std::abs(depth.at<std::uint16_t>(y, x) - 1600) < 20;
    // 64 disparities are tried; of these columns, too, all but the first 16 are seen by both.
    for (int x = 20; x < 60; ++x) left_rim += std::abs(depth.at<std::uint16_t>(y, x) - 1600) < 20;
  }
  EXPECT_GT(found, 0.95 * 160 * 180);
  EXPECT_GT(left_rim, 0.95 * 160 * 40);
}

TEST(StereoDepth, NothingToBeSeenGivesNothing) {
  const Rig rig = small_rig();
  const cv::Mat grey(240, 320, CV_8UC1, cv::Scalar(100));
  EXPECT_LT(cv::countNonZero(stereo_depth(rig, grey, grey, 0.5)), 0.01 * 320 * 240);
  EXPECT_LT(cv::countNonZero(stereo_depth(rig, random_texture(1), random_texture(2), 0.5)), 0.02 * 320 * 240);
}

/// How disparities differ from the renderer's, where both cameras see the surface.
struct DisparityErrors {
  double found = 0;  ///< share of pixels
  double bias = 0;   ///< median [px]
  double sigma = 0;  ///< 1.48 times the median deviation [px]
  double wrong = 0;  ///< share of found ones that are off by more than a pixel
};

DisparityErrors errors_of(const cv::Mat& depth, const cv::Mat& inverse_depth, const Rig& rig) {
  const double fb = rig.camera.fx * rig.baseline;
  std::vector<double> errors;
  double all = 0, wrong = 0;
  for (int y = 0; y < depth.rows; ++y) {
    std::vector<double> nearest(static_cast<std::size_t>(depth.cols),
                                0);  // of each column of the right image
    const auto column = [&](int x) { return std::lround(x - fb * inverse_depth.at<float>(y, x)); };
    for (int x = 0; x < depth.cols; ++x)
      if (const auto u = column(x); u >= 0)
        nearest[static_cast<std::size_t>(u)] =
            std::max<double>(nearest[static_cast<std::size_t>(u)], fb * inverse_depth.at<float>(y, x));
    for (int x = 0; x < depth.cols; ++x) {
      const double truth = fb * inverse_depth.at<float>(y, x);
      const auto u = column(x);
      if (truth < 6 || u < 0 || nearest[static_cast<std::size_t>(u)] > truth + 1) continue;
      ++all;
      const double z = rig.depth_unit * depth.at<std::uint16_t>(y, x);
      if (z <= 0) continue;
      errors.push_back(fb / z - truth);
      wrong += std::abs(errors.back()) > 1;
    }
  }
  const auto median = [](std::vector<double>& values) {
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  };
  DisparityErrors found{static_cast<double>(errors.size()) / all, median(errors), 0,
                        wrong / static_cast<double>(errors.size())};
  for (double& e : errors) e = std::abs(e - found.bias);
  found.sigma = 1.4826 * median(errors);
  return found;
}

TEST(StereoDepth, KnowsDisparitiesToATenthOfAPixel) {
  synthetic::SyntheticOptions options = synthetic::default_options("desk");
  options.sensor = SensorKind::kStereo;
  const synthetic::SyntheticSequence desk(options);
  for (const int n : {0, 300}) {
    const Frame frame = desk.render(n);
    const cv::Mat truth = desk.exact_view(n).inverse_depth;
    // The right camera may see all a little darker, and less of contrast.
    for (const double gain : {1.0, 0.9}) {
      cv::Mat right;
      frame.right.convertTo(right, CV_8U, gain, 10 * (1 - gain));
      const DisparityErrors found =
          errors_of(stereo_depth(desk.rig(), frame.left, right, 0.4), truth, desk.rig());
      std::printf("frame %d, gain %g: %.3f found, bias %.4f px, sigma %.3f px, %.4f wrong\n", n, gain,
                  found.found, found.bias, found.sigma, found.wrong);
      EXPECT_GT(found.found, 0.91);
      EXPECT_LT(std::abs(found.bias), 0.015);
      EXPECT_LT(found.sigma, gain == 1 ? 0.1 : 0.12);
      EXPECT_LT(found.wrong, 0.02);
    }
  }
}

}  // namespace
}  // namespace twofold
