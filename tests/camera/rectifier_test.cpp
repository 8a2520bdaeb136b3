#include "camera/rectifier.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "tests/camera/example_rigs.hpp"

namespace twofold {
namespace {

float sample(const cv::Mat& map, double u, double v) {
  cv::Mat value;
  cv::getRectSubPix(map, {1, 1}, cv::Point2f(static_cast<float>(u), static_cast<float>(v)), value);
  return value.at<float>(0, 0);
}

class StereoRectifier : public ::testing::TestWithParam<Calibration> {};
INSTANTIATE_TEST_SUITE_P(Rigs, StereoRectifier,
                         ::testing::Values(euroc(), fisheye(), double_sphere(), rational()));

/// Project points through the raw cameras and look up, in the maps, the rectified pixels that show these raw
/// pixels.
TEST_P(StereoRectifier, MapsSendRectifiedProjectionsToRawProjections) {
  const Calibration& c = GetParam();
  const Rectifier rectifier(c);
  const Rig& rig = rectifier.rig();
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> u(2, rig.camera.width - 3), v(2, rig.camera.height - 3),
      depth(0.4, 30);
  int seen = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3 x_rectified = depth(rng) * rig.camera.unproject({u(rng), v(rng)});
    const Vector3 z = rig.project(x_rectified);
    const Vector3 x_l = rectifier.R_rectified_left().inverse() * x_rectified;
    const Vector2 raw_l = c.left.project(x_l);
    EXPECT_NEAR(sample(rectifier.left_map().x, z.x(), z.y()), raw_l.x(), 0.02);
    EXPECT_NEAR(sample(rectifier.left_map().y, z.x(), z.y()), raw_l.y(), 0.02);
    if (z.z() < 2) continue;
    ++seen;
    const Vector2 raw_r = c.right.project(c.T_right_left * x_l);
    EXPECT_NEAR(sample(rectifier.right_map().x, z.z(), z.y()), raw_r.x(), 0.02);
    EXPECT_NEAR(sample(rectifier.right_map().y, z.z(), z.y()), raw_r.y(), 0.02);
  }
  EXPECT_GT(seen, 1000);
}

/// The other way round, without the rig: undistorting and rotating raw projections must give equal rows.
TEST_P(StereoRectifier, CorrespondingPointsShareTheirRow) {
  const Calibration& c = GetParam();
  const Rectifier rectifier(c);
  const PinholeCamera& camera = rectifier.rig().camera;
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> u(0, c.left.pinhole.width - 1), v(0, c.left.pinhole.height - 1),
      depth(0.4, 30);
  int both = 0;
  for (int i = 0; i < 2000; ++i) {
    const auto ray = c.left.unproject({u(rng), v(rng)});
    if (!ray) continue;
    const Vector3 x_l = depth(rng) * *ray;
    const Vector3 x_r = c.T_right_left * x_l;
    if (x_r.z() < 0.1) continue;
    const auto ray_l = c.left.unproject(c.left.project(x_l));
    const auto ray_r = c.right.unproject(c.right.project(x_r));
    if (!ray_l || !ray_r) continue;
    ++both;
    const Vector2 uv_l = camera.project(rectifier.R_rectified_left() * *ray_l);
    const Vector2 uv_r = camera.project(rectifier.R_rectified_right() * *ray_r);
    EXPECT_NEAR(uv_l.y(), uv_r.y(), 1e-6);
    const double z = (rectifier.R_rectified_left() * x_l).z();
    EXPECT_NEAR(uv_l.x() - uv_r.x(), rectifier.rig().disparity_from_depth(z), 1e-6);
  }
  EXPECT_GT(both, 1500);
}

TEST_P(StereoRectifier, EveryPixelHasASourceAndMostOfTheImageStays) {
  const Calibration& c = GetParam();
  const Rectifier rectifier(c);
  const auto check = [](const RectificationMap& map, const PinholeCamera& raw) {
    double low, high;
    cv::minMaxLoc(map.x, &low, &high);
    EXPECT_GE(low, -0.5);
    EXPECT_LE(high, raw.width - 0.5);
    cv::minMaxLoc(map.y, &low, &high);
    EXPECT_GE(low, -0.5);
    EXPECT_LE(high, raw.height - 0.5);
  };
  check(rectifier.left_map(), c.left.pinhole);
  check(rectifier.right_map(), c.right.pinhole);

  int kept = 0, all = 0;
  for (int v = 0; v < c.left.pinhole.height; v += 5) {
    for (int u = 0; u < c.left.pinhole.width; u += 5) {
      ++all;
      const auto ray = c.left.unproject(Vector2(u, v));
      if (!ray) continue;
      const Vector3 x = rectifier.R_rectified_left() * *ray;
      if (x.z() > 0 && rectifier.rig().camera.contains(rectifier.rig().camera.project(x))) ++kept;
    }
  }
  // EuRoC: 79 % (as with the common focal length of 435 px). The squinting fisheyes lose more.
  EXPECT_GT(kept, (c.left.distortion.model == DistortionModel::kRadTan ? 0.75 : 0.6) * all)
      << kept << " of " << all;
}

TEST_P(StereoRectifier, FullFieldKeepsEveryRawPixelWithinTheLimit) {
  const Calibration& c = GetParam();
  const Rectifier rectifier(c, {.field = 1, .max_half_field_deg = 75});
  const double limit = std::tan(75 * M_PI / 180);
  for (int v = 0; v < c.left.pinhole.height; v += 7) {
    for (int u = 0; u < c.left.pinhole.width; u += 7) {
      const auto ray = c.left.unproject(Vector2(u, v));
      if (!ray) continue;
      const Vector3 x = rectifier.R_rectified_left() * *ray;
      if (x.z() <= 0 || (x.head<2>() / x.z()).lpNorm<Eigen::Infinity>() > limit) continue;
      EXPECT_TRUE(rectifier.rig().camera.contains(rectifier.rig().camera.project(x), -1.0)) << u << ", " << v;
    }
  }
}

TEST(Rectifier, EurocBaselineAndFocalLength) {
  const Rectifier rectifier(euroc());
  EXPECT_NEAR(rectifier.rig().baseline, 0.110074, 1e-5);
  EXPECT_NEAR(rectifier.rig().camera.fx, 435, 15);  // about what this head is commonly rectified to
  EXPECT_EQ(rectifier.rig().camera.fx, rectifier.rig().camera.fy);
  EXPECT_LT(rectifier.R_rectified_left().log().norm(), 0.05);
}

TEST(Rectifier, PassesRectifiedImagesThrough) {
  Calibration c;
  c.left = c.right = {{700, 700, 600, 180, 1241, 376}, {}};
  c.T_right_left = SE3(SO3(), {-0.54, 0, 0});
  c.already_rectified = true;
  const Rectifier rectifier(c);
  EXPECT_TRUE(rectifier.passes_through());
  EXPECT_EQ(rectifier.rig().baseline, 0.54);
  const Frame raw{0, 0, cv::Mat(376, 1241, CV_8UC1), cv::Mat(376, 1241, CV_8UC1), {}};
  Frame out;
  rectifier.rectify(raw, out);
  EXPECT_EQ(out.left.data, raw.left.data);
  EXPECT_EQ(out.right.data, raw.right.data);
}

TEST(Rectifier, UndistortsDepthWithoutMixingSurfaces) {
  Calibration c;
  c.kind = SensorKind::kRgbd;
  c.left = euroc().left;
  const Rectifier rectifier(c);
  EXPECT_FALSE(rectifier.passes_through());
  EXPECT_EQ(rectifier.rig().baseline, c.virtual_baseline);
  Frame raw{
      0, 0, cv::Mat(480, 752, CV_8UC1, cv::Scalar(9)), {}, cv::Mat(480, 752, CV_16UC1, cv::Scalar(1000))};
  raw.depth.colRange(300, 752).setTo(5000);
  ASSERT_EQ(rectifier.mismatch_reason(raw), "");
  Frame out;
  rectifier.rectify(raw, out);
  const int near = cv::countNonZero(out.depth == 1000);
  const int far = cv::countNonZero(out.depth == 5000);
  EXPECT_EQ(near + far, 480 * 752);
  EXPECT_GT(near, 100000);
}

/// A lens that folds at this radius and grows again a little farther out: what lies beyond would be seen
/// twice.
class FoldingLens : public ::testing::TestWithParam<std::pair<Distortion, double>> {};
INSTANTIATE_TEST_SUITE_P(
    Models, FoldingLens,
    ::testing::Values(std::pair(Distortion{DistortionModel::kRadTan, {-0.6, 0, 0, 0, 0.1}}, 0.8218),
                      std::pair(Distortion{DistortionModel::kRational,
                                           {0.0826, -2.605, 0, 0, 1.595, -0.0417, -2.42, 1.517}},
                                1.042),
                      // 1 + 3 k1 t^2 + 5 k2 t^4 is zero at t = 0.78585, and again at 0.96.
                      std::pair(Distortion{DistortionModel::kEquidistant, {-0.9, 0.35}}, 1.0009)));

TEST_P(FoldingLens, ShowsNothingBeyondItsFold) {
  const auto [lens, fold] = GetParam();
  Calibration c;
  c.kind = SensorKind::kMono;
  c.left = {{300, 300, 500, 350, 1000, 700}, lens};
  const Rectifier rectifier(c, {.field = 1, .max_half_field_deg = 65});
  int within = 0, beyond = 0;
  for (int v = 0; v < rectifier.rig().camera.height; v += 5) {
    for (int u = 0; u < rectifier.rig().camera.width; u += 5) {
      const double r = rectifier.rig().camera.unproject(Vector2(u, v)).head<2>().norm();
      const bool seen = rectifier.left_map().x.at<float>(v, u) > -1000;
      if (std::abs(r - fold) < 0.001) continue;
      EXPECT_EQ(seen, r < fold) << r;
      ++(r < fold ? within : beyond);
    }
  }
  EXPECT_GT(within, 1000);
  EXPECT_GT(beyond, 1000);
}

std::string error_of(const Calibration& c, const RectifierOptions& options = {}) {
  try {
    const Rectifier rectifier(c, options);
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

Calibration one_fisheye(const Distortion::Coefficients& k) {
  Calibration c;
  c.kind = SensorKind::kMono;
  c.left = {{300, 300, 319.5, 239.5, 640, 480}, {DistortionModel::kEquidistant, k}};
  return c;
}

/// Coefficients of another model, or in another order: the lens folds long before the image ends.
TEST(Rectifier, RefusesALensThatLeavesMostOfTheImageBlack) {
  EXPECT_NE(error_of(one_fisheye({-3, 0, 0, 0})).find("% are black"), std::string::npos)
      << error_of(one_fisheye({-3, 0, 0, 0}));
  EXPECT_EQ(error_of(one_fisheye({-0.01, 0.01, 0, 0})), "");
  EXPECT_EQ(error_of(one_fisheye({-3, 0, 0, 0}), {.field = 1}), "") << "black is what was asked for";
}

TEST(Rectifier, SaysHowMuchOfTheImageIsBlack) {
  EXPECT_EQ(Rectifier(euroc()).black_share(), 0);
  EXPECT_EQ(Rectifier(euroc()).black_note(), "");
  const Rectifier half(one_fisheye({-0.42, 0, 0, 0}));
  int black = 0;
  cv::Mat white(480, 640, CV_8UC1, cv::Scalar(255));
  Frame out;
  half.rectify({0, 0, white, {}, {}}, out);
  black = 640 * 480 - cv::countNonZero(out.left);
  EXPECT_GT(half.black_share(), 0.2) << "or this says nothing";
  EXPECT_NEAR(half.black_share(), black / (640.0 * 480), 0.01);
  EXPECT_EQ(half.black_note(), "of the rectified image " +
                                   std::to_string(std::lround(100 * half.black_share())) + " % are black");
}

/// All four edges of a fisheye's image are behind it: the limit alone says how far the rectified one goes.
TEST(Rectifier, TakesALensThatSeesToAllSides) {
  Calibration c;
  c.kind = SensorKind::kMono;
  c.left = {{150, 150, 319.5, 239.5, 640, 480}, {DistortionModel::kEquidistant, {}}};
  for (const double field : {0.0, 1.0}) {
    const PinholeCamera camera = Rectifier(c, {.field = field, .max_half_field_deg = 60}).rig().camera;
    EXPECT_NEAR(camera.fx, (field == 0 ? 319.5 : 239.5) / std::tan(60 * M_PI / 180), 1e-9);
    EXPECT_NEAR(camera.cx, 319.5, 1e-9);
    EXPECT_NEAR(camera.cy, 239.5, 1e-9);
  }
}

TEST(Rectifier, MonoWithoutDistortionKeepsItsIntrinsics) {
  Calibration c;
  c.kind = SensorKind::kMono;
  c.left = {{500, 510, 320, 240, 640, 480}, {}};
  const Rectifier rectifier(c);
  EXPECT_TRUE(rectifier.passes_through());
  EXPECT_EQ(rectifier.rig().camera.fy, 510);
}

TEST(Rectifier, RejectsLengthsInOtherUnits) {
  Calibration c = euroc();
  c.T_right_left = SE3(c.T_right_left.so3(), 1000 * c.T_right_left.translation());
  EXPECT_NE(error_of(c).find("was it given in millimetres?"), std::string::npos) << error_of(c);
  c = euroc();
  c.left.pinhole.fx = c.left.pinhole.fy = 3.6;
  EXPECT_NE(error_of(c).find("focal lengths in pixels, of an image 752 wide"), std::string::npos)
      << error_of(c);
  c = euroc();
  c.left.pinhole.fx *= 10;
  EXPECT_NE(error_of(c).find("fx, fy must be nearly the same"), std::string::npos) << error_of(c);
}

TEST(Rectifier, RejectsWhatItCannotRectify) {
  Calibration c = euroc();
  c.right.pinhole.fx = 0;
  EXPECT_NE(error_of(c).find("right camera: fx"), std::string::npos);
  c = euroc();
  c.T_right_left = c.T_right_left.inverse();  // cameras swapped
  EXPECT_NE(error_of(c).find("T_right_left"), std::string::npos);
  c = euroc();
  c.T_right_left = SE3(SO3::exp({0, 2.5, 0}), {-0.1, 0, 0.05});  // looking away from each other
  EXPECT_NE(error_of(c), "");
  c = euroc();
  c.already_rectified = true;
  EXPECT_NE(error_of(c).find("already_rectified"), std::string::npos);
  EXPECT_NE(error_of(euroc(), {.field = 2}).find("field"), std::string::npos);
  EXPECT_NE(error_of(euroc(), {.width = 640}).find("width"), std::string::npos);
}

TEST(Rectifier, SaysHowAFrameDiffersFromTheCalibration) {
  const Rectifier rectifier(euroc());
  Frame raw{0, 0, cv::Mat(480, 752, CV_8UC1), {}, {}};
  EXPECT_EQ(rectifier.mismatch_reason(raw), "the right image is missing");
  raw.right = cv::Mat(480, 640, CV_8UC1);
  EXPECT_EQ(rectifier.mismatch_reason(raw),
            "the right image has 640 x 480 pixels, the calibration says 752 x 480");
  raw.right = cv::Mat(480, 752, CV_8UC3);
  EXPECT_EQ(rectifier.mismatch_reason(raw), "the right image is not 8-bit grey");
}

}  // namespace
}  // namespace twofold
