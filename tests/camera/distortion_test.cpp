#include "camera/distortion.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "camera/camera_model.hpp"
#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

const Distortion kRadTan{DistortionModel::kRadTan, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}};
const Distortion kRadTan5{DistortionModel::kRadTan, {0.1, -0.2, 0.001, -0.002, 0.05}};
const Distortion kFisheye{DistortionModel::kEquidistant, {-0.0087, 0.0122, -0.0116, 0.0037, 0}};
const Distortion kDoubleSphere{DistortionModel::kDoubleSphere, {-0.2, 0.57, 0, 0, 0}};
/// Of a depth sensor's colour camera, whose maker calibrates every one of them with this model.
const Distortion kRational{DistortionModel::kRational,
                           {0.4371, -2.5066, 0.0006, -0.0002, 1.4637, 0.3137, -2.3387, 1.3903}};
/// Numerator and denominator nearly cancel each other; folds at r = 1.042, and grows again from 1.1 on.
const Distortion kFoldingRational{DistortionModel::kRational,
                                  {0.0826, -2.605, 0.0006, -0.0002, 1.595, -0.0417, -2.42, 1.517}};
const Distortion kNone{};

class AnyDistortion : public ::testing::TestWithParam<Distortion> {};
INSTANTIATE_TEST_SUITE_P(Models, AnyDistortion,
                         ::testing::Values(kNone, kRadTan, kRadTan5, kFisheye, kDoubleSphere, kRational));

TEST_P(AnyDistortion, JacobianMatchesCentralDifference) {
  std::mt19937 rng(2);
  std::uniform_real_distribution<double> xy(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const double size = i % 10 == 0 ? 1e-7 : 1;
    const Vector2 p(size * xy(rng), size * xy(rng));
    Eigen::Matrix2d J;
    (void)GetParam().distort(p, &J);
    const auto J_num = central_difference([&](const Vector2& x) { return GetParam().distort(x); }, p);
    EXPECT_LT((J - J_num).norm(), 1e-8) << p.transpose();
  }
}

TEST_P(AnyDistortion, UndistortInvertsDistort) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> xy(-0.8, 0.8);
  for (int i = 0; i < 500; ++i) {
    const Vector2 p(xy(rng), 0.7 * xy(rng));
    const auto back = GetParam().undistort(GetParam().distort(p));
    ASSERT_TRUE(back.has_value()) << p.transpose();
    EXPECT_LT((*back - p).norm(), 1e-10) << p.transpose();
  }
}

TEST(Distortion, UndistortFailsBeyondTheFold) {
  // r (1 - 0.3 r^2) is largest at r = 1.054, where it is 0.703: nothing lands further out.
  const Distortion folding{DistortionModel::kRadTan, {-0.3, 0, 0, 0, 0}};
  EXPECT_TRUE(folding.undistort({0.69, 0}));
  EXPECT_FALSE(folding.undistort({0.72, 0}));
  EXPECT_FALSE(folding.undistort({5, 5}));
  // An equidistant image ends at theta = pi/2.
  const Distortion fisheye{DistortionModel::kEquidistant, {}};
  EXPECT_TRUE(fisheye.undistort({1.5, 0}));
  EXPECT_FALSE(fisheye.undistort({1.6, 0}));
}

/// cv::projectPoints through a camera of focal length 1.
TEST(Distortion, IsThatOfOpenCv) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int lens = 0; lens < 50; ++lens) {
    Distortion distortion = kRational;
    if (lens % 5 == 4) distortion = kRadTan5;
    for (int i = 0; i < distortion.coefficient_count(); ++i)
      distortion.coefficients[i] += (i == 2 || i == 3 ? 0.002 : 0.2) * unit(rng);
    std::vector<cv::Point3d> points;
    for (int i = 0; i < 40; ++i) {
      const double z = 2 + unit(rng);
      points.emplace_back(z * unit(rng), z * 0.7 * unit(rng), z);
    }
    const cv::Mat k(1, distortion.coefficient_count(), CV_64F, distortion.coefficients.data());
    std::vector<cv::Point2d> projected;
    cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), cv::Matx33d::eye(), k, projected);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Vector2 xy(points[i].x / points[i].z, points[i].y / points[i].z);
      const Vector2 expected(projected[i].x, projected[i].y);
      EXPECT_LT((distortion.distort(xy) - expected).norm(), 1e-12 * (1 + expected.norm())) << xy.transpose();
    }
  }
}

TEST(Distortion, RationalWithoutDenominatorIsRadialTangential) {
  const Distortion quotient{DistortionModel::kRational, kRadTan5.coefficients};
  for (const double x : {0.0, 0.3, -0.7}) {
    EXPECT_LT((quotient.distort({x, 0.4}) - kRadTan5.distort({x, 0.4})).norm(), 1e-15);
  }
}

/// The same lens twice: EuRoC's polynomial times 1 + k4 r^2, over it.
TEST(Distortion, ACommonFactorOfAQuotientCancels) {
  const double k1 = kRadTan.coefficients[0], k2 = kRadTan.coefficients[1], k4 = 0.4;
  const Distortion expanded{
      DistortionModel::kRational,
      {k1 + k4, k2 + k1 * k4, kRadTan.coefficients[2], kRadTan.coefficients[3], k2 * k4, k4, 0, 0}};
  for (const Vector2& xy : {Vector2(0, 0), Vector2(0.3, -0.2), Vector2(-0.8, 0.5)}) {
    EXPECT_LT((expanded.distort(xy) - kRadTan.distort(xy)).norm(), 1e-15);
    const auto undistorted = expanded.undistort(xy), of_radtan = kRadTan.undistort(xy);
    ASSERT_EQ(undistorted.has_value(), of_radtan.has_value());
    if (undistorted) {
      EXPECT_LT((*undistorted - *of_radtan).norm(), 1e-9);
    }
  }
}

TEST(Distortion, UndistortFailsBeyondTheFoldOfAQuotient) {
  // It grows up to r = 1.042, where it is 1.44, falls to 1.27 at r = 1.17, and grows again without end.
  const auto along_x = [](double r) { return kFoldingRational.distort({r, 0}); };
  ASSERT_GT(along_x(1.04).x(), along_x(1.2).x());
  ASSERT_GT(along_x(1.6).x(), along_x(1.04).x());
  for (const double r : {0.5, 0.9, 1.0, 1.03}) {
    const auto back = kFoldingRational.undistort(along_x(r));
    ASSERT_TRUE(back) << r;
    EXPECT_LT((*back - Vector2(r, 0)).norm(), 1e-10);
  }
  EXPECT_FALSE(kFoldingRational.undistort(along_x(1.6)));
  EXPECT_TRUE(kFoldingRational.reaches({1.04, 0}));
  EXPECT_FALSE(kFoldingRational.reaches({0, 1.045}));
  Eigen::Matrix2d J;
  (void)kFoldingRational.distort({1.6, 0}, &J);
  ASSERT_GT(J.determinant(), 0);
  EXPECT_FALSE(kFoldingRational.reaches({1.6, 0})) << "the Jacobian does not tell";
}

TEST(Distortion, AFisheyeThatTurnsInsideOutReachesItsFold) {
  // theta - theta^3: it folds at 33.1 degrees, and is upside down beyond 57.3.
  const Distortion lens{DistortionModel::kEquidistant, {-1, 0, 0, 0}};
  EXPECT_TRUE(lens.reaches({std::tan(33 * M_PI / 180), 0}));
  EXPECT_FALSE(lens.reaches({0, std::tan(33.2 * M_PI / 180)}));
  Eigen::Matrix2d J;
  const Vector2 beyond(std::tan(60 * M_PI / 180), 0);
  (void)lens.distort(beyond, &J);
  ASSERT_GT(J.determinant(), 0) << "the Jacobian does not tell";
  EXPECT_FALSE(lens.reaches(beyond));
  EXPECT_TRUE((Distortion{DistortionModel::kEquidistant, {}}.reaches({100, 100})));
}

TEST(Distortion, UndistortStaysBeforeAPole) {
  // r / (1 - r^2): every radius before the pole at r = 1, and again every one behind it.
  const Distortion pole{DistortionModel::kRational, {0, 0, 0, 0, 0, -1, 0, 0}};
  for (const double r : {0.1, 0.9, 0.99, 0.9999}) {
    const auto back = pole.undistort({0, r / (1 - r * r)});
    ASSERT_TRUE(back) << r;
    EXPECT_LT((*back - Vector2(0, r)).norm(), 1e-9);
  }
  EXPECT_TRUE(pole.reaches({0.7, 0.7}));
  EXPECT_FALSE(pole.reaches({1.000001, 0}));
  EXPECT_FALSE(pole.reaches({1.5, 0}));
  // (1 - r^2)(1 - r^2 / 1.1) in the denominator: positive again behind the second pole.
  const Distortion poles{DistortionModel::kRational, {0, 0, 0, 0, 0, -1 - 1 / 1.1, 1 / 1.1, 0}};
  EXPECT_GT(poles.distort({1.2, 0}).x(), 0);
  EXPECT_FALSE(poles.reaches({1.2, 0}));
  const auto back = poles.undistort(poles.distort({1.2, 0}));
  ASSERT_TRUE(back);
  EXPECT_LT(back->x(), 1) << "what the lens sees there";
}

/// Whatever numbers a file has: a point that is given back is one that the lens sees at this pixel.
TEST(Distortion, UndistortsWhatIsSeenOrNothing) {
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> unit(-1, 1);
  int found = 0, none = 0;
  for (int i = 0; i < 20000; ++i) {
    Distortion lens{i % 2 == 0 ? DistortionModel::kRational : DistortionModel::kRadTan, {}};
    for (double& k : lens.coefficients) k = std::pow(10, 3 * unit(rng) - 1) * unit(rng);
    const Vector2 xy_d(2 * unit(rng), 2 * unit(rng));
    const auto xy = lens.undistort(xy_d);
    ++(xy ? found : none);
    if (!xy) continue;
    EXPECT_LT((lens.distort(*xy) - xy_d).norm(), 1e-8);
    EXPECT_TRUE(lens.reaches(*xy)) << xy->transpose();
  }
  EXPECT_GT(found, 2000);
  EXPECT_GT(none, 2000);
}

/// Along the radius alone there is one point for each pixel that is seen.
TEST(Distortion, UndistortsAllThatIsSeen) {
  std::mt19937 rng(8);
  std::uniform_real_distribution<double> unit(-1, 1);
  int seen = 0;
  for (int i = 0; i < 20000; ++i) {
    Distortion lens{DistortionModel::kRational, {}};
    for (double& k : lens.coefficients) k = std::pow(10, 3 * unit(rng) - 1) * unit(rng);
    lens.coefficients[2] = lens.coefficients[3] = 0;
    const Vector2 xy(1.5 * unit(rng), 1.5 * unit(rng));
    if (!lens.reaches(1.01 * xy)) continue;  // not at the fold itself, where Newton's steps are lost
    ++seen;
    const auto back = lens.undistort(lens.distort(xy));
    ASSERT_TRUE(back) << "lens " << i;
    Eigen::Matrix2d J;
    (void)lens.distort(xy, &J);
    EXPECT_LT((J * (*back - xy)).norm(), 1e-8) << "lens " << i;
  }
  EXPECT_GT(seen, 2000);
}

TEST(Distortion, FisheyeSeriesJoinsClosedForm) {
  const Vector2 inside = kFisheye.distort({0.9999e-6, 0});
  const Vector2 outside = kFisheye.distort({1.0001e-6, 0});
  EXPECT_NEAR((outside - inside).x(), 2e-10, 1e-15);
}

TEST(Distortion, UndistortsNothingThatIsNotFinite) {
  for (const Distortion& lens : {kNone, kRadTan, kFisheye, kDoubleSphere, kRational}) {
    for (const double x : {double{NAN}, double{INFINITY}, -1e200}) {
      EXPECT_FALSE(lens.undistort({x, 0})) << static_cast<int>(lens.model) << " " << x;
    }
  }
}

TEST(Distortion, SaysWhatIsInvalid) {
  EXPECT_EQ(kRadTan.invalid_reason(), "");
  Distortion bad = kRadTan;
  bad.coefficients[1] = NAN;
  EXPECT_NE(bad.invalid_reason().find("coefficient 2"), std::string::npos);
  EXPECT_NE((Distortion{DistortionModel::kDoubleSphere, {0, 1.5}}).invalid_reason(), "");
  bad = kRational;
  EXPECT_EQ(bad.invalid_reason(), "");
  bad.coefficients[7] = INFINITY;
  EXPECT_NE(bad.invalid_reason().find("coefficient 8"), std::string::npos);
  bad.coefficients[7] = -1e10;
  EXPECT_NE(bad.invalid_reason().find("coefficient 8 must be within 1e9"), std::string::npos);
}

TEST(Distortion, WithoutCoefficientsIsNone) {
  EXPECT_TRUE((Distortion{DistortionModel::kRadTan, {}}).is_identity());
  EXPECT_TRUE((Distortion{DistortionModel::kRational, {}}).is_identity());
  EXPECT_FALSE((Distortion{DistortionModel::kRational, {0, 0, 0, 0, 0, 0, 0, 1e-3}}).is_identity());
  EXPECT_FALSE((Distortion{DistortionModel::kEquidistant, {}}).is_identity());
  // What radial-tangential has no use for is ignored.
  EXPECT_TRUE((Distortion{DistortionModel::kRadTan, {0, 0, 0, 0, 0, 0.1, 0, 0}}).is_identity());
}

TEST(CameraModel, ProjectionJacobianAndInverse) {
  const CameraModel camera{{458.654, 457.296, 367.215, 248.375, 752, 480}, kRadTan};
  std::mt19937 rng(4);
  std::uniform_real_distribution<double> u(0, 751), v(0, 479), depth(0.5, 20);
  for (int i = 0; i < 200; ++i) {
    const Vector2 uv(u(rng), v(rng));
    const auto ray = camera.unproject(uv);
    ASSERT_TRUE(ray);
    const Vector3 x_c = depth(rng) * *ray;
    Matrix23 J;
    EXPECT_LT((camera.project(x_c, &J) - uv).norm(), 1e-8);
    const auto J_num = central_difference([&](const Vector3& x) { return camera.project(x); }, x_c);
    EXPECT_LT((J - J_num).norm(), 1e-6 * J.norm());
  }
}

/// Every pixel of a 1280 x 720 image, corners and principal point included.
TEST(CameraModel, OfARationalLensIsInvertedAllOverItsImage) {
  const CameraModel camera{{610.3, 610.1, 638.7, 367.4, 1280, 720}, kRational};
  double farthest = 0;
  for (int v = 0; v <= 720; v += 9) {
    for (int u = 0; u <= 1280; u += 8) {
      const Vector2 uv(std::min(u, 1279), std::min(v, 719));
      const auto ray = camera.unproject(uv);
      ASSERT_TRUE(ray) << uv.transpose();
      farthest = std::max(farthest, (camera.project(*ray) - uv).norm());
    }
  }
  EXPECT_LT(farthest, 1e-9);
}

/// Its maker's tools print k1 to k6 first and p2, p1 last.
TEST(CameraModel, SaysThatCoefficientsAreInAnotherOrder) {
  CameraModel camera{{610.3, 610.1, 638.7, 367.4, 1280, 720}, kRational};
  EXPECT_EQ(camera.invalid_reason(), "");
  const auto [k1, k2, p1, p2, k3, k4, k5, k6] = kRational.coefficients;
  camera.distortion.coefficients = {k1, k2, k3, k4, k5, k6, p2, p1};
  EXPECT_NE(camera.invalid_reason().find("k1 k2 p1 p2 k3 k4 k5 k6, in this order"), std::string::npos);
  // Only corners beyond its fold: they stay black.
  camera.distortion = kFoldingRational;
  camera.pinhole.fx = camera.pinhole.fy = 480;
  EXPECT_FALSE(camera.unproject({0, 0}));
  EXPECT_EQ(camera.invalid_reason(), "");
}

}  // namespace
}  // namespace twofold
