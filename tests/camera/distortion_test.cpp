#include "camera/distortion.hpp"

#include <gtest/gtest.h>

#include <random>

#include "camera/camera_model.hpp"
#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

const Distortion kRadTan{DistortionModel::kRadTan, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}};
const Distortion kRadTan5{DistortionModel::kRadTan, {0.1, -0.2, 0.001, -0.002, 0.05}};
const Distortion kFisheye{DistortionModel::kEquidistant, {-0.0087, 0.0122, -0.0116, 0.0037, 0}};
const Distortion kDoubleSphere{DistortionModel::kDoubleSphere, {-0.2, 0.57, 0, 0, 0}};
const Distortion kNone{};

class AnyDistortion : public ::testing::TestWithParam<Distortion> {};
INSTANTIATE_TEST_SUITE_P(Models, AnyDistortion,
                         ::testing::Values(kNone, kRadTan, kRadTan5, kFisheye, kDoubleSphere));

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

TEST(Distortion, FisheyeSeriesJoinsClosedForm) {
  const Vector2 inside = kFisheye.distort({0.9999e-6, 0});
  const Vector2 outside = kFisheye.distort({1.0001e-6, 0});
  EXPECT_NEAR((outside - inside).x(), 2e-10, 1e-15);
}

TEST(Distortion, SaysWhatIsInvalid) {
  EXPECT_EQ(kRadTan.invalid_reason(), "");
  Distortion bad = kRadTan;
  bad.coefficients[1] = NAN;
  EXPECT_NE(bad.invalid_reason().find("coefficient 2"), std::string::npos);
  EXPECT_NE((Distortion{DistortionModel::kDoubleSphere, {0, 1.5}}).invalid_reason(), "");
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

}  // namespace
}  // namespace twofold
