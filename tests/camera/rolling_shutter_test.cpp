#include "camera/rolling_shutter.hpp"

#include <gtest/gtest.h>

#include <random>

namespace twofold {
namespace {

Rig rolling_rig() {
  Rig rig;
  rig.kind = SensorKind::kStereo;
  rig.camera = {500, 500, 320, 240, 640, 480};
  rig.baseline = 0.1;
  rig.readout = 0.03;
  return rig;
}

// Walking while turning at 70 degrees a second: 18 pixels from the first row to the last.
const Vector6 kVelocity = (Vector6() << 0.5, -0.3, 0.8, 0.4, 1.2, -0.5).finished();

/// Where a moving camera with a rolling shutter sees a point: on the row that is exposed when it is there.
Vector3 measured(const Rig& rig, const Vector3& x_c) {
  Vector3 z = rig.project(x_c);
  for (int i = 0; i < 20; ++i) {
    const double tau = ((z.y() + 0.5) / rig.camera.height - 0.5) * *rig.readout;
    z = rig.project(SE3::exp(tau * kVelocity) * x_c);
  }
  return z;
}

TEST(RollingShutter, TurnsMeasurementsIntoThoseOfAGlobalShutter) {
  const Rig rig = rolling_rig();
  const RollingShutter shutter(rig, kVelocity);
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(20, 620), v(20, 460), depth(2, 8);
  double moved = 0;
  for (int i = 0; i < 200; ++i) {
    const Vector3 x_c = rig.camera.unproject({u(rng), v(rng)}) * depth(rng);
    const Vector3 z = measured(rig, x_c);
    moved = std::max(moved, (z - rig.project(x_c)).norm());
    EXPECT_LT((shutter.at_mid_exposure(rig, z, x_c) - rig.project(x_c)).norm(), 1e-9);
    // The point is not known so well: half a decimetre costs little.
    const Vector3 x_off = x_c * (1 + 0.05 / x_c.z());
    EXPECT_LT((shutter.at_mid_exposure(rig, z, x_off) - rig.project(x_c)).norm(), 0.2);
  }
  EXPECT_GT(moved, 8);
}

TEST(RollingShutter, SaysFromWhereAPointIsSeen) {
  const Rig rig = rolling_rig();
  const RollingShutter shutter(rig, kVelocity);
  const SE3 T_c_w = SE3::exp((Vector6() << 1, 2, 3, 0.2, -0.1, 0.4).finished());
  const Vector3 x_c = rig.camera.unproject({100, 450}) * 3;
  const Vector3 x_w = T_c_w.inverse() * x_c;
  const Vector3 predicted = rig.project(shutter.seen_from(rig, T_c_w, x_w) * x_w);
  EXPECT_GT((rig.project(x_c) - measured(rig, x_c)).norm(), 5);
  EXPECT_LT((predicted - measured(rig, x_c)).norm(), 0.5);
}

/// 30 ms of frames at 25 Hz: by the frame before, and by the next one.
TEST(RollingShutter, AFollowedCornerSaysItselfWhereItWasAtMidExposure) {
  const Rig rig = rolling_rig();
  const double interval = 0.04;
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> u(60, 580), v(60, 420), depth(2, 8);
  double moved = 0, worst = 0;
  for (int i = 0; i < 200; ++i) {
    const Vector3 x_c = rig.camera.unproject({u(rng), v(rng)}) * depth(rng);
    const Vector2 seen = measured(rig, x_c).head<2>(), truth = rig.project(x_c).head<2>();
    moved = std::max(moved, (seen - truth).norm());
    for (const double step : {-interval, interval}) {
      const Vector2 other = measured(rig, SE3::exp(step * kVelocity) * x_c).head<2>();
      const Vector2 motion = step > 0 ? other - seen : seen - other;
      const Vector2 found = followed_to_mid_exposure(rig.camera, seen, motion, *rig.readout / interval);
      worst = std::max(worst, (found - truth).norm());
    }
  }
  EXPECT_GT(moved, 8);
  EXPECT_LT(worst, 0.15 * moved);
}

TEST(RollingShutter, IsAGlobalOneWithoutReadoutOrMotion) {
  Rig rig = rolling_rig();
  const Vector3 x_c(0.4, -0.7, 3);
  const Vector3 z = rig.project(x_c);
  EXPECT_EQ(RollingShutter().at_mid_exposure(rig, z, x_c), z);
  EXPECT_EQ(RollingShutter(rig, Vector6::Zero()).at_mid_exposure(rig, z, x_c), z);
  rig.readout = 0;
  EXPECT_EQ(RollingShutter(rig, kVelocity).at_mid_exposure(rig, z, x_c), z);
}

}  // namespace
}  // namespace twofold
