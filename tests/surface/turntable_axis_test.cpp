#include "surface/turntable_axis.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace twofold {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

struct Way {
  std::vector<double> seconds;
  std::vector<SE3> T_w_c;
};

/// Camera about the axis through `point`, `degrees` a frame, 30 frames a second.
Way turning(const Vector3& direction, const Vector3& point, double degrees, int frames, double noise = 0) {
  std::mt19937 random(2);
  std::normal_distribution<double> any(0, noise);
  const SE3 T_w_c0(SO3::exp(Vector3(0.3, -2, 0.4)), point + Vector3(0.3, 0.25, 0.2));
  Way way;
  for (int n = 0; n < frames; ++n) {
    const SO3 R = SO3::exp(direction * (n * degrees * kDegree));
    const SE3 turn(R, point - R * point);
    const SE3 shaken(SO3::exp(0.3 * Vector3(any(random), any(random), any(random))),
                     Vector3(any(random), any(random), any(random)));
    way.seconds.push_back(n / 30.0);
    way.T_w_c.push_back(turn * T_w_c0 * shaken);
  }
  return way;
}

TEST(TurntableAxis, IsFoundOverTwoTurns) {
  const Vector3 direction = Vector3(0.1, -0.9, 0.2).normalized(), point(0.1, 0.2, 0.6);
  // The camera goes round clockwise as seen from above: before it, the object turns the other way.
  const Way way = turning(direction, point, -1.2, 600, 0.001);
  const auto axis = fit_turntable_axis(way.seconds, way.T_w_c, direction);
  ASSERT_TRUE(axis);
  EXPECT_LT(axis->direction.cross(direction).norm(), 0.002);
  EXPECT_GT(axis->direction.dot(direction), 0);
  EXPECT_LT((axis->point - point).cross(direction).norm(), 0.001);
  EXPECT_NEAR(axis->rate / kDegree, 36, 0.1);
  EXPECT_NEAR(axis->turned / kDegree, 599 * 1.2, 1);
  EXPECT_LT(axis->deviation, 0.004);
}

TEST(TurntableAxis, UpDecidesTheSign) {
  const Way way = turning(Vector3::UnitZ(), {0.1, 0, 0}, 2, 100);
  const auto above = fit_turntable_axis(way.seconds, way.T_w_c, {0.2, 0, 1});
  const auto below = fit_turntable_axis(way.seconds, way.T_w_c, {0.2, 0, -1});
  ASSERT_TRUE(above && below);
  EXPECT_NEAR(above->rate / kDegree, -60, 0.1);
  EXPECT_NEAR(below->rate / kDegree, 60, 0.1);
}

TEST(TurntableAxis, AWayThatIsNoTurningDeviates) {
  Way way = turning(Vector3::UnitZ(), {0.1, 0, 0}, 2, 100);
  for (std::size_t n = 0; n < way.T_w_c.size(); ++n)
    way.T_w_c[n] = SE3(SO3(), Vector3(0, 0, 0.004 * static_cast<double>(n))) * way.T_w_c[n];
  const auto axis = fit_turntable_axis(way.seconds, way.T_w_c, Vector3::UnitZ());
  ASSERT_TRUE(axis);
  EXPECT_GT(axis->deviation, 0.03);
}

TEST(TurntableAxis, NothingForACameraThatStoodStill) {
  const Way way = turning(Vector3::UnitZ(), {0.1, 0, 0}, 0.01, 100);
  EXPECT_FALSE(fit_turntable_axis(way.seconds, way.T_w_c, Vector3::UnitZ()));
  EXPECT_FALSE(fit_turntable_axis({}, {}, Vector3::UnitZ()));
}

TEST(TurntableAxis, TakesTwoPairsOfPosesTwentyDegreesApart) {
  const Way one_pair = turning(Vector3::UnitZ(), {0.1, 0, 0}, 1, 22);  // 0 and 21 degrees
  EXPECT_FALSE(fit_turntable_axis(one_pair.seconds, one_pair.T_w_c, Vector3::UnitZ()));
  const Way two_pairs = turning(Vector3::UnitZ(), {0.1, 0, 0}, 1, 23);
  EXPECT_TRUE(fit_turntable_axis(two_pairs.seconds, two_pairs.T_w_c, Vector3::UnitZ()));
}

TEST(TurntableAxis, NothingForAPlateThatTurnedBack) {
  Way way = turning(Vector3::UnitZ(), {0.1, 0, 0}, 1, 60);
  for (std::size_t n = 31; n < way.T_w_c.size(); ++n) way.T_w_c[n] = way.T_w_c[60 - n];  // ends at 1 degree
  EXPECT_FALSE(fit_turntable_axis(way.seconds, way.T_w_c, Vector3::UnitZ()));
}

}  // namespace
}  // namespace twofold
