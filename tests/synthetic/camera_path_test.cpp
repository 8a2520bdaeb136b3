#include "synthetic/camera_path.hpp"
#include "base/angles.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

namespace twofold::synthetic {
namespace {

// What the header promises of a flight, sampled every two milliseconds for two minutes.
TEST(FlownCamera, SwingsByWhatTheHeaderSays) {
  constexpr double kDt = 0.002, kDegree = std::numbers::pi / 180;
  const CameraPath still = [](double) { return SE3(); };
  const CameraPath flight = flown(still, 1);
  double shift = 0, turn = 0, speed = 0, turning = 0;
  SE3 before = flight(0);
  for (double t = kDt; t < 120; t += kDt) {
    const SE3 now = flight(t);
    shift = std::max(shift, now.translation().norm());
    turn = std::max(turn, now.so3().log().norm());
    speed = std::max(speed, (now.translation() - before.translation()).norm() / kDt);
    turning = std::max(turning, (before.so3().inverse() * now.so3()).log().norm() / kDt);
    before = now;
  }
  EXPECT_NEAR(shift, 0.47, 0.01);
  EXPECT_NEAR(turn, 27 * kDegree, 1 * kDegree);
  EXPECT_NEAR(speed, 1.3, 0.05);
  EXPECT_NEAR(turning, 124 * kDegree, 4 * kDegree);
}

// The swing is the camera's own: where the path turns, it turns along.
TEST(FlownCamera, SwingsInItsOwnFrame) {
  const SE3 T_w_path = looking({3, -2, 1.5}, 1.2, 0.1, -0.2);
  const CameraPath at_origin = flown([](double) { return SE3(); }, 2);
  const CameraPath elsewhere = flown([&](double) { return T_w_path; }, 2);
  for (const double t : {0.3, 1.7, 20.0})
    EXPECT_LT((elsewhere(t).inverse() * T_w_path * at_origin(t)).log().norm(), 1e-12) << t;
}

}  // namespace
}  // namespace twofold::synthetic
