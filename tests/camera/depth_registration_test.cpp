#include "camera/depth_registration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "camera/rectifier.hpp"
#include "synthetic/synthetic_sequence.hpp"

namespace twofold {
namespace {

constexpr double kUnit = 0.0002;  // [m]

/// A Kinect's colour camera, and the depth camera 2.5 cm beside it, of another focal length; half of their
/// size.
Calibration kinect() {
  Calibration calibration;
  calibration.kind = SensorKind::kRgbd;
  calibration.left.pinhole = {262, 263, 158, 121, 320, 240};
  calibration.depth_unit = kUnit;
  calibration.depth_apart = true;
  calibration.depth_camera.model.pinhole = {293, 292, 161, 118, 320, 240};
  calibration.depth_camera.T_left_depth =
      SE3(SO3::exp(Vector3(0.004, -0.006, 0.003)), Vector3(-0.025, 0.001, 0.002));
  return calibration;
}

cv::Mat rendered_depth(const PinholeCamera& camera, const SE3& T_w_c) {
  static const synthetic::SyntheticSequence desk(synthetic::default_options("desk"));
  const cv::Mat inverse = synthetic::Renderer(desk.scene()).render(camera, T_w_c).inverse_depth;
  cv::Mat depth;
  cv::Mat(1 / (kUnit * inverse)).convertTo(depth, CV_16U);
  return depth;
}

SE3 rendered_from() {
  return synthetic::SyntheticSequence(synthetic::default_options("desk")).T_w_c(0);
}

/// How well registered depth is that of the camera itself, away from where the latter jumps.
struct Agreement {
  double there = 0;  ///< share of pixels that have a reading
  double right = 0;  ///< of these, within half a percent
};

Agreement agreement(const cv::Mat& registered, const cv::Mat& direct) {
  double all = 0, there = 0, right = 0;
  for (int y = 22; y < direct.rows - 22; ++y) {  // the depth camera sees less on all sides
    for (int x = 36; x < direct.cols - 36; ++x) {
      double low = 0, high = 0;
      cv::minMaxLoc(direct(cv::Rect(x - 4, y - 2, 9, 5)), &low, &high);
      if (high > 1.1 * low) continue;
      ++all;
      const double z = registered.at<std::uint16_t>(y, x), z0 = direct.at<std::uint16_t>(y, x);
      there += z > 0;
      right += std::abs(z - z0) < 0.005 * z0;
    }
  }
  return {there / all, right / there};
}

TEST(DepthRegistration, IsWhatTheOtherCameraWouldHaveSeen) {
  const Calibration calibration = kinect();
  const SE3 T_w_c = rendered_from();
  const PinholeCamera& colour = calibration.left.pinhole;
  const cv::Mat direct = rendered_depth(colour, T_w_c);
  // A finer and a coarser depth camera.
  for (const double scale : {1.0, 0.5}) {
    DepthCamera camera = calibration.depth_camera;
    PinholeCamera& p = camera.model.pinhole;
    p = {scale * p.fx,
         scale * p.fy,
         scale * p.cx,
         scale * p.cy,
         static_cast<int>(scale * p.width),
         static_cast<int>(scale * p.height)};
    const cv::Mat taken = rendered_depth(p, T_w_c * camera.T_left_depth);
    cv::Mat registered;
    DepthRegistration(camera, SE3(), colour, kUnit).apply(taken, registered);
    const Agreement found = agreement(registered, direct);
    std::printf("scale %g: %.4f there, %.4f of these right\n", scale, found.there, found.right);
    EXPECT_GT(found.there, 0.985) << scale;
    EXPECT_GT(found.right, 0.99) << scale;
  }
}

/// A pixel of a camera with a lens has the depth, along the axis, of what a pinhole in its place sees there.
TEST(DepthRegistration, TakesDepthThroughALensOfTheRationalModel) {
  const Calibration calibration = kinect();
  const SE3 T_w_c = rendered_from();
  DepthCamera camera = calibration.depth_camera;
  camera.model.distortion = {DistortionModel::kRational,
                             {5.12, 3.41, 0.0001, -0.0001, 0.171, 5.44, 5.02, 0.903}};
  const PinholeCamera ideal{600, 600, 540, 420, 1080, 840};
  const cv::Mat seen = rendered_depth(ideal, T_w_c * camera.T_left_depth);
  cv::Mat taken(camera.model.pinhole.height, camera.model.pinhole.width, CV_16UC1);
  for (int v = 0; v < taken.rows; ++v) {
    for (int u = 0; u < taken.cols; ++u) {
      const auto ray = camera.model.unproject(Vector2(u, v));
      ASSERT_TRUE(ray);
      const Vector2 uv = ideal.project(*ray);
      ASSERT_TRUE(ideal.contains(uv)) << uv.transpose();
      taken.at<std::uint16_t>(v, u) = seen.at<std::uint16_t>(cvRound(uv.y()), cvRound(uv.x()));
    }
  }
  cv::Mat registered;
  DepthRegistration(camera, SE3(), calibration.left.pinhole, kUnit).apply(taken, registered);
  const Agreement found = agreement(registered, rendered_depth(calibration.left.pinhole, T_w_c));
  std::printf("through a lens: %.4f there, %.4f of these right\n", found.there, found.right);
  EXPECT_GT(found.there, 0.985);
  EXPECT_GT(found.right, 0.99);
}

TEST(DepthRegistration, KeepsTheNearestOfTwoSurfacesAndMixesNone) {
  DepthCamera camera;
  camera.model.pinhole = {100, 100, 20, 10, 41, 21};
  camera.T_left_depth = SE3(SO3(), Vector3(0.1, 0, 0));
  cv::Mat depth(21, 41, CV_16UC1, cv::Scalar(2000));
  depth.colRange(15, 25) = cv::Scalar(1000);  // moves by 10 pixels, the wall behind it by 5
  cv::Mat registered;
  DepthRegistration(camera, SE3(), camera.model.pinhole, 0.001).apply(depth, registered);
  for (int y = 1; y < 20; ++y) {
    for (int x = 8; x < 41; ++x) {
      const int z = registered.at<std::uint16_t>(y, x);
      const bool thing = x >= 25 && x < 35;
      const bool shadow = x >= 20 && x < 25;  // of the wall: only the colour camera sees it
      EXPECT_EQ(z, thing ? 1000 : shadow ? 0 : 2000) << x;
    }
  }
}

TEST(DepthRegistration, ReadingsThatAreNoneGiveNone) {
  const Calibration calibration = kinect();
  const DepthRegistration registration(calibration.depth_camera, SE3(), calibration.left.pinhole, kUnit);
  for (const int all : {0, 1, 65535}) {
    cv::Mat registered;
    registration.apply(cv::Mat(240, 320, CV_16UC1, cv::Scalar(all)), registered);
    ASSERT_EQ(registered.size(), cv::Size(320, 240));
    EXPECT_EQ(cv::countNonZero(registered) > 0, all > 100) << all;
  }
}

/// Seen farther out than whole numbers of pixels reach; this must end, and write nothing outside.
TEST(DepthRegistration, EndsForReadingsAlmostInTheOthersPlane) {
  Calibration calibration = kinect();
  calibration.depth_camera.T_left_depth = SE3(SO3(), Vector3(0.3, 0.2, -500 * kUnit + 1e-8));
  const DepthRegistration registration(calibration.depth_camera, SE3(), calibration.left.pinhole, kUnit);
  cv::Mat registered;
  registration.apply(cv::Mat(240, 320, CV_16UC1, cv::Scalar(500)), registered);
  EXPECT_EQ(registered.size(), cv::Size(320, 240));
}

TEST(DepthRegistration, IsTheRectifiersWhenTheCalibrationHasADepthCamera) {
  Calibration calibration = kinect();
  calibration.left.distortion.model = DistortionModel::kRadTan;
  calibration.left.distortion.coefficients = {0.1, -0.2, 0.001, -0.001, 0};
  DepthCamera& camera = calibration.depth_camera;
  camera.model.pinhole = {140, 140, 80, 60, 160, 120};
  const Rectifier rectifier(calibration);
  const SE3 T_w_c = rendered_from();
  Frame raw;
  raw.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(100));
  raw.depth = cv::Mat(240, 320, CV_16UC1, cv::Scalar(1000));
  EXPECT_NE(rectifier.mismatch_reason(raw).find("160 x 120"), std::string::npos);
  raw.depth = rendered_depth(camera.model.pinhole, T_w_c * camera.T_left_depth);
  EXPECT_EQ(rectifier.mismatch_reason(raw), "");
  Frame rectified;
  rectifier.rectify(raw, rectified);
  const Agreement found = agreement(rectified.depth, rendered_depth(rectifier.rig().camera, T_w_c));
  EXPECT_GT(found.there, 0.985);
  EXPECT_GT(found.right, 0.99);
  camera.T_left_depth = SE3(SO3(), Vector3(std::nan(""), 0, 0));
  EXPECT_NE(calibration.invalid_reason().find("T_left_depth"), std::string::npos);
}

}  // namespace
}  // namespace twofold
