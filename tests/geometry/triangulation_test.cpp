#include "geometry/triangulation.hpp"

#include <gtest/gtest.h>

#include <random>

namespace twofold {
namespace {

const SE3 kT_a_b = SE3::exp((Vector6() << 0.4, -0.1, 0.05, 0.02, -0.1, 0.05).finished());

TEST(TriangulateMidpoint, RecoversExactPoints) {
  std::mt19937 rng(3);
  std::uniform_real_distribution<double> xy(-1, 1), depth(1, 30);
  for (int i = 0; i < 200; ++i) {
    const double z = depth(rng);
    const Vector3 x_a(xy(rng) * z, xy(rng) * z, z);
    const Vector3 x_b = kT_a_b.inverse() * x_a;
    const auto x = triangulate_midpoint(x_a.normalized(), x_b.normalized(), kT_a_b, 1e-4);
    ASSERT_TRUE(x.has_value());
    EXPECT_LT((*x - x_a).norm(), 1e-9 * x_a.norm() * x_a.norm());
  }
}

TEST(TriangulateMidpoint, LiesHalfwayBetweenSkewRays) {
  // Rays along z through the origin and along x through (-5, 0.2, 4).
  const SE3 T_a_b(SO3::exp({0, M_PI / 2, 0}), Vector3(-5, 0.2, 4));
  const auto x = triangulate_midpoint(Vector3::UnitZ(), Vector3::UnitZ(), T_a_b, 0.1);
  ASSERT_TRUE(x.has_value());
  EXPECT_LT((*x - Vector3(0, 0.1, 4)).norm(), 1e-12);
}

TEST(TriangulateMidpoint, SaysWhyItFails) {
  const Vector3 far_a(0.1, 0, 1000);
  const Vector3 far_b = kT_a_b.inverse() * far_a;
  const auto low = triangulate_midpoint(far_a.normalized(), far_b.normalized(), kT_a_b, 0.01);
  ASSERT_FALSE(low.has_value());
  EXPECT_EQ(low.error(), TriangulationError::kLowParallax);

  const auto parallel = triangulate_midpoint(Vector3::UnitZ(), Vector3::UnitZ(), SE3(SO3(), {1, 0, 0}), 0.0);
  ASSERT_FALSE(parallel.has_value());
  EXPECT_EQ(parallel.error(), TriangulationError::kLowParallax);

  const SE3 shift(SO3(), Vector3(1, 0, 0));  // rays that diverge meet behind both cameras
  const auto behind =
      triangulate_midpoint(Vector3(-0.1, 0, 1).normalized(), Vector3(0.1, 0, 1).normalized(), shift, 0.01);
  ASSERT_FALSE(behind.has_value());
  EXPECT_EQ(behind.error(), TriangulationError::kBehindCamera);
}

}  // namespace
}  // namespace twofold
