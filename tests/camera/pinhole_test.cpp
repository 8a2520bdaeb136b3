#include "camera/pinhole.hpp"

#include <gtest/gtest.h>

#include <random>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "tests/numeric_derivative.hpp"

namespace twofold {
namespace {

const PinholeCamera kCamera{450, 455, 320, 240, 640, 480};

Rig stereo_rig() {
  Rig rig;
  rig.camera = kCamera;
  rig.baseline = 0.12;
  return rig;
}

TEST(Pinhole, JacobiansMatchCentralDifferences) {
  const Rig rig = stereo_rig();
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> xy(-2, 2), depth(0.5, 20);
  for (int i = 0; i < 200; ++i) {
    const Vector3 x_c(xy(rng), xy(rng), depth(rng));
    const auto J = kCamera.project_jacobian(x_c);
    const auto J_num = central_difference([&](const Vector3& x) { return kCamera.project(x); }, x_c);
    EXPECT_LT((J - J_num).norm(), 1e-6 * J.norm()) << x_c.transpose();
    const auto J_rig = rig.project_jacobian(x_c);
    const auto J_rig_num = central_difference([&](const Vector3& x) { return rig.project(x); }, x_c);
    EXPECT_LT((J_rig - J_rig_num).norm(), 1e-6 * J_rig.norm()) << x_c.transpose();
    EXPECT_LT((rig.unproject(rig.project(x_c)) - x_c).norm(), 1e-9 * x_c.squaredNorm());
  }
}

TEST(Pinhole, PyramidLevelKeepsTheAreaOfPixels) {
  const PinholeCamera half = kCamera.at_level(1);
  EXPECT_EQ(half.width, 320);
  EXPECT_EQ(half.height, 240);
  // Level-1 pixel (10, 20) covers level-0 pixels (20..21, 40..41), centred at (20.5, 40.5).
  const Vector3 ray = kCamera.unproject({20.5, 40.5});
  EXPECT_LT((half.project(ray) - Vector2(10, 20)).norm(), 1e-12);
}

TEST(Pinhole, FindsInViewWhatIsInFrontAndInside) {
  EXPECT_TRUE(kCamera.find_in_view({0, 0, 2}));
  EXPECT_EQ(kCamera.find_in_view({0, 0, 2}), kCamera.project({0, 0, 2}));
  EXPECT_FALSE(kCamera.find_in_view({0, 0, -2}));     // behind
  EXPECT_TRUE(kCamera.find_in_view({0, 0, 0.0005}));  // in whatever unit
  EXPECT_FALSE(kCamera.find_in_view({2, 0, 2}));      // beside
  const Vector3 near_rim = kCamera.unproject({5, 100});
  EXPECT_TRUE(kCamera.find_in_view(near_rim, 4));
  EXPECT_FALSE(kCamera.find_in_view(near_rim, 6));
}

TEST(Measurement, OneOfTheLeftImageAloneHasNoRightCoordinate) {
  const Rig rig = stereo_rig();
  Vector3 z = rig.project({0.1, 0.2, 3});
  EXPECT_TRUE(has_right(z));
  EXPECT_TRUE(has_right(z.cast<float>()));
  z.z() = Rig::kNoRight;
  EXPECT_FALSE(has_right(z));
  EXPECT_FALSE(has_right(z.cast<float>()));
  EXPECT_FALSE(has_right(z.z()));
}

TEST(Measurement, ARightCoordinateCountsWhereItWasFoundAndTheRigHasABaseline) {
  Rig rig = stereo_rig();
  const Eigen::Vector3f z = rig.project({0.1, 0.2, 3}).cast<float>();
  const Eigen::Vector3f left(z.x(), z.y(), static_cast<float>(Rig::kNoRight));
  EXPECT_TRUE(weighs_right(rig.information(z, 0)));
  EXPECT_FALSE(weighs_right(rig.information(left, 0)));
  rig.kind = SensorKind::kMono;  // goes on with the map of a rig
  EXPECT_TRUE(has_right(z));
  EXPECT_FALSE(weighs_right(rig.information(z, 0)));
}

TEST(MeasurementNoise, FallsByFourALevelAndIsNoneWithoutARightCoordinate) {
  Rig rig = stereo_rig();
  rig.noise = {.sigma_px = 2, .depth_sigma_px = 4};
  EXPECT_EQ(rig.information({1, 1, 1}, 0), Eigen::Vector3f(0.25F, 0.25F, 0.25F));
  EXPECT_EQ(rig.information({1, 1, 1}, 1), Eigen::Vector3f(0.0625F, 0.0625F, 0.0625F));
  EXPECT_EQ(rig.information({1, 1, static_cast<float>(Rig::kNoRight)}, 0), Eigen::Vector3f(0.25F, 0.25F, 0));
  rig.kind = SensorKind::kRgbd;
  EXPECT_EQ(rig.information({1, 1, 1}, 1), Eigen::Vector3f(0.0625F, 0.0625F, 0.0625F));
  rig.kind = SensorKind::kMono;
  EXPECT_EQ(rig.information({1, 1, 1}, 0), Eigen::Vector3f(0.25F, 0.25F, 0));
}

TEST(InFront, InWhateverUnit) {
  for (const double unit : {1e-5, 1.0, 1e5}) {
    EXPECT_TRUE(in_front_of_camera(unit * Vector3(0, 0, 0.5))) << unit;
    EXPECT_TRUE(in_front_of_camera(unit * Vector3(3, -2, 0.5))) << unit;
    EXPECT_FALSE(in_front_of_camera(unit * Vector3(0, 0, -0.5))) << unit;
    EXPECT_FALSE(in_front_of_camera(unit * Vector3(3, -2, 1e-4))) << "to the side, " << unit;
  }
  EXPECT_FALSE(in_front_of_camera(Vector3(0, 0, 0)));
}

}  // namespace
}  // namespace twofold
