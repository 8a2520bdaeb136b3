#include "geometry/triangulation.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "geometry/inverse_depth.hpp"

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

std::vector<InverseDepthView> views_of(const Vector3& x_a, double noise, std::mt19937& rng) {
  std::normal_distribution<double> normal(0, 1);
  std::vector<InverseDepthView> views;
  for (int i = 0; i < 8; ++i) {
    const SE3 T_c_a =
        SE3::exp((Vector6() << 0.1 * i, 0.03 * i, -0.02 * i, 0.01 * i, -0.02 * i, 0).finished());
    const Vector3 x_c = T_c_a * x_a;
    views.push_back({T_c_a, x_c.head<2>() / x_c.z() + noise * Vector2(normal(rng), normal(rng))});
  }
  return views;
}

TEST(RefineInverseDepth, ConvergesToThePointFromAPoorStart) {
  std::mt19937 rng(4);
  const Vector3 x_a(0.5, -0.4, 6);
  const auto views = views_of(x_a, 0, rng);
  for (const double depth : {1.0, 3.0, 20.0, 1000.0}) {
    const auto psi = refine_inverse_depth(Vector3(0, 0, 1 / depth), views);
    ASSERT_TRUE(psi.has_value()) << depth;
    EXPECT_LT((from_inverse_depth(*psi) - x_a).norm(), 1e-7) << depth;
  }
}

TEST(RefineInverseDepth, IsTheLeastSquaresMinimum) {
  std::mt19937 rng(5);
  const auto views = views_of({0.5, -0.4, 6}, 2e-3, rng);
  const auto psi = refine_inverse_depth(Vector3(0, 0, 0.2), views);
  ASSERT_TRUE(psi.has_value());
  const auto cost = [&](const Vector3& p) {
    double sum = 0;
    for (const auto& view : views) {
      const Vector3 x = view.T_c_a * from_inverse_depth(p);
      sum += (view.xy - x.head<2>() / x.z()).squaredNorm();
    }
    return sum;
  };
  for (int k = 0; k < 3; ++k) {
    for (const double h : {1e-4, -1e-4}) EXPECT_GT(cost(*psi + h * Vector3::Unit(k)), cost(*psi));
  }
}

TEST(RefineInverseDepth, SaysWhyItFails) {
  const std::vector<InverseDepthView> one{{SE3(), Vector2(0, 0)}};
  const auto singular = refine_inverse_depth({0, 0, 0.5}, one);
  ASSERT_FALSE(singular.has_value());
  EXPECT_EQ(singular.error(), TriangulationError::kLowParallax);
  const auto behind = refine_inverse_depth({0, 0, -0.5}, one);
  ASSERT_FALSE(behind.has_value());
  EXPECT_EQ(behind.error(), TriangulationError::kBehindCamera);
}

}  // namespace
}  // namespace twofold
