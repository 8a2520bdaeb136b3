#include "twofold/types.hpp"

#include <gtest/gtest.h>

#include "twofold/eigen.hpp"
#include "twofold/opencv.hpp"

namespace twofold {
namespace {

const Pose kPose{{0.5, -0.5, 0.5, 0.5}, {1, 2, 3}};

TEST(PublicTypes, PosesComposeAsTheirMatrices) {
  const Pose other{{0, 0, std::sqrt(0.5), std::sqrt(0.5)}, {-1, 0, 0.5}};
  const Eigen::Isometry3d expected = to_eigen(kPose) * to_eigen(other);
  EXPECT_TRUE(to_eigen(compose(kPose, other)).isApprox(expected, 1e-12));
  EXPECT_TRUE(to_eigen(inverse(kPose)).isApprox(to_eigen(kPose).inverse(), 1e-12));
  const std::array<double, 3> p = transform(kPose, {1, 0, 0});
  EXPECT_TRUE(
      (to_eigen(kPose) * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(p[0], p[1], p[2]), 1e-12));
}

TEST(PublicTypes, EigenAndBack) {
  const Pose back = from_eigen(to_eigen(kPose));
  const double sign = back.q[3] * kPose.q[3] < 0 ? -1 : 1;
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(sign * back.q[i], kPose.q[i], 1e-12);
  EXPECT_EQ(back.t, kPose.t);
}

TEST(PublicTypes, OpenCvImagesAreSeenWhereTheyAre) {
  cv::Mat large(10, 20, CV_16UC1);
  const cv::Mat part = large(cv::Rect(5, 2, 8, 6));
  const ImageView seen = view(part);
  EXPECT_EQ(seen.data, part.data);
  EXPECT_EQ(seen.width, 8);
  EXPECT_EQ(seen.height, 6);
  EXPECT_EQ(seen.stride, 40);
  EXPECT_EQ(seen.format, ImageFormat::kDepth16);
  EXPECT_EQ(view(cv::Mat(1, 1, CV_8UC3)).format, ImageFormat::kBgr8);
  EXPECT_EQ(view(cv::Mat()).data, nullptr);
  EXPECT_THROW((void)view(cv::Mat(1, 1, CV_64FC1)), std::invalid_argument);
}

}  // namespace
}  // namespace twofold
