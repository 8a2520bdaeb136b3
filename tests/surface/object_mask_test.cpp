#include "surface/object_mask.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "tests/surface/ball_views.hpp"

namespace twofold {
namespace {

constexpr double kNoise = 1.425e-3;

ObjectMaskOptions mask_options() {
  ObjectMaskOptions o;
  o.depth_noise = kNoise;
  return o;
}

/// A camera half a metre from the origin that looks down by `down` [rad].
SE3 looking_down(double down) {
  const Vector3 eye = 0.5 * Vector3(0, -std::cos(down), std::sin(down));
  const Vector3 z = -eye.normalized(), x = Vector3::UnitX();
  Matrix3 R_w_c;
  R_w_c << x, z.cross(x), z;
  return SE3(R_w_c, eye).inverse();
}

/// What a scene of a ball of 5 cm on a plate of edge 0.3 m, 2 cm above a table, shows.
class ObjectMaskTest : public ::testing::Test {
 protected:
  enum Part : std::uint8_t { kNone, kBall, kPlate, kTable };

  cv::Mat render(const SE3& T_c_w, bool with_ball = true) {
    std::mt19937 random(3);
    std::normal_distribution<double> noise(0, kNoise);
    parts_ = cv::Mat(rig_.camera.height, rig_.camera.width, CV_8UC1, cv::Scalar(kNone));
    cv::Mat depth(parts_.size(), CV_16UC1, cv::Scalar(0));
    const SE3 T_w_c = T_c_w.inverse();
    for (int y = 0; y < depth.rows; ++y) {
      for (int x = 0; x < depth.cols; ++x) {
        const Vector3 ray_c = rig_.camera.unproject(Vector2(x, y));
        const Vector3 ray = T_w_c.so3() * ray_c, eye = T_w_c.translation();
        double z = (-0.02 - eye.z()) / ray.z();
        Part part = z > 0 ? kTable : kNone;
        const double on_plate = -eye.z() / ray.z();
        const Vector3 at = eye + on_plate * ray;
        if (on_plate > 0 && std::abs(at.x()) < 0.15 && std::abs(at.y()) < 0.15) {
          z = on_plate;
          part = kPlate;
        }
        const Vector3 to_ball = eye - ball_.centre;
        const double b = ray.dot(to_ball) / ray.squaredNorm();
        const double q = b * b - (to_ball.squaredNorm() - ball_.radius * ball_.radius) / ray.squaredNorm();
        if (with_ball && q > 0) {
          z = -b - std::sqrt(q);
          part = kBall;
        }
        if (part == kNone || z > 8) continue;
        parts_.at<std::uint8_t>(y, x) = part;
        depth.at<std::uint16_t>(y, x) =
            static_cast<std::uint16_t>(std::lround((z + noise(random) * z * z) / rig_.depth_unit));
      }
    }
    return depth;
  }
  int count(const cv::Mat& mask, Part part) const { return cv::countNonZero((parts_ == part) & mask); }

  Rig rig_ = [] {
    Rig rig = testing::depth_rig();
    rig.depth_unit = 0.0002;
    return rig;
  }();
  testing::Ball ball_{{0.02, 0.01, 0.05}, 0.05};
  cv::Mat parts_;
};

TEST_F(ObjectMaskTest, FindsWhatStandsOnTheUpperOfTwoPlanes) {
  ObjectMasker masker(rig_, mask_options());
  const auto mask = masker.mask(render(looking_down(0.6)));
  ASSERT_TRUE(mask) << mask.error();
  const cv::Mat all(parts_.size(), CV_8UC1, cv::Scalar(255));
  EXPECT_GT(count(*mask, kBall), 0.75 * count(all, kBall));  // without foot and rim
  EXPECT_EQ(count(*mask, kPlate), 0);
  EXPECT_EQ(count(*mask, kTable), 0);
  const Vector3 foot = looking_down(0.6) * Vector3(0, 0, 0);
  EXPECT_NEAR(masker.plane().height(foot), 0, 0.001);
  EXPECT_NEAR(masker.plane().height({0, 0, 0}), 0.5 * std::sin(0.6), 0.002);
}

TEST_F(ObjectMaskTest, FollowsThePlaneOfACameraThatWalks) {
  ObjectMasker masker(rig_, mask_options());
  for (int n = 0; n < 20; ++n) {
    const auto mask = masker.mask(render(looking_down(0.5 + 0.01 * n)));
    ASSERT_TRUE(mask) << mask.error();
    EXPECT_EQ(count(*mask, kPlate) + count(*mask, kTable), 0) << n;
    EXPECT_GT(cv::countNonZero(*mask), 1000) << n;
  }
}

TEST_F(ObjectMaskTest, WhatIsHeldIsAllThatIsNearEnough) {
  const SE3 T_c_w = SE3(SO3(), Vector3(0, 0, 0.4)) * looking_down(0.6);
  ball_.centre = T_c_w.inverse() * Vector3(0, 0, 0.5);  // in mid-air; plate and table are beyond the cut
  ObjectMaskOptions options = mask_options();
  options.farthest = 0.54;
  options.held = true;
  const cv::Mat depth = render(T_c_w);
  const cv::Mat all(parts_.size(), CV_8UC1, cv::Scalar(255));
  ObjectMasker masker(rig_, options);
  const auto mask = masker.mask(depth);
  ASSERT_TRUE(mask) << mask.error();
  EXPECT_GT(count(*mask, kBall), 0.75 * count(all, kBall));
  EXPECT_EQ(count(*mask, kPlate) + count(*mask, kTable), 0);
  EXPECT_EQ(masker.up(), Vector3(0, -1, 0));
  EXPECT_FALSE(reaches_border(*mask, options.erode));
}

TEST_F(ObjectMaskTest, WhatGoesOnBeyondTheImageReachesItsBorder) {
  const auto reaches = [](const cv::Rect& shown) {
    cv::Mat mask(60, 80, CV_8UC1, cv::Scalar(0));
    mask(shown).setTo(255);
    return reaches_border(mask, 2);
  };
  EXPECT_FALSE(reaches({10, 10, 20, 20}));
  EXPECT_FALSE(reaches({3, 3, 74, 54}));
  EXPECT_TRUE(reaches({2, 10, 20, 20})) << "its rim was taken away";
  EXPECT_TRUE(reaches({10, 10, 68, 20}));
  EXPECT_TRUE(reaches({10, 10, 20, 48}));
}

TEST_F(ObjectMaskTest, SaysWhatIsMissing) {
  const cv::Mat none(rig_.camera.height, rig_.camera.width, CV_16UC1, cv::Scalar(0));
  const auto without_depth = ObjectMasker(rig_, mask_options()).mask(none);
  ASSERT_FALSE(without_depth);
  EXPECT_NE(without_depth.error().find("hardly any depth"), std::string::npos);

  const auto empty_plate = ObjectMasker(rig_, mask_options()).mask(render(looking_down(0.6), false));
  ASSERT_FALSE(empty_plate);
  EXPECT_NE(empty_plate.error().find("nothing is left above"), std::string::npos);

  cv::Mat scattered(none.size(), CV_16UC1);
  std::mt19937 random(4);
  for (int i = 0; i < static_cast<int>(scattered.total()); ++i)
    scattered.at<std::uint16_t>(i) = static_cast<std::uint16_t>(1600 + random() % 2300);  // 0.32 to 0.78 m
  const auto no_plane = ObjectMasker(rig_, mask_options()).mask(scattered);
  ASSERT_FALSE(no_plane);
  EXPECT_NE(no_plane.error().find("no plane"), std::string::npos);
}

TEST_F(ObjectMaskTest, NoEdgeMarksWhereTheMaskEnds) {
  cv::Mat image(120, 160, CV_8UC1, cv::Scalar(40)), mask(image.size(), CV_8UC1, cv::Scalar(0));
  image(cv::Rect(50, 30, 60, 60)).setTo(200);
  mask(cv::Rect(52, 32, 56, 56)).setTo(255);
  image.at<std::uint8_t>(60, 80) = 10;
  const cv::Mat filled = fill_outside(image, mask);
  EXPECT_EQ(filled.at<std::uint8_t>(60, 80), 10);
  cv::Mat other;
  cv::compare(filled, 200, other, cv::CMP_NE);
  EXPECT_EQ(cv::countNonZero(other), 1);  // all else is as the object's rim
  EXPECT_EQ(cv::countNonZero(fill_outside(image, cv::Mat::zeros(image.size(), CV_8UC1)) != 128), 0);
}

TEST_F(ObjectMaskTest, MovesByItsDisparityInTheRightImage) {
  cv::Mat mask(rig_.camera.height, rig_.camera.width, CV_8UC1, cv::Scalar(0));
  mask(cv::Rect(150, 60, 40, 30)).setTo(255);
  const cv::Mat depth(mask.size(), CV_16UC1, cv::Scalar(5000));  // 1 m
  const int disparity = static_cast<int>(std::lround(rig_.camera.fx * rig_.baseline));
  const cv::Mat right = mask_in_right(rig_, mask, depth);
  EXPECT_EQ(cv::countNonZero(right), 40 * 30);
  EXPECT_EQ(cv::countNonZero(right(cv::Rect(150 - disparity, 60, 40, 30))), 40 * 30);
}

}  // namespace
}  // namespace twofold
