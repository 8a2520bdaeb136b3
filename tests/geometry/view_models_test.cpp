// What else explains two views: a rotation on the spot, a plane.
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "geometry/homography.hpp"
#include "geometry/se3.hpp"
#include "geometry/view_rotation.hpp"

namespace twofold {
namespace {

constexpr double kNoise = 1e-3;

struct Views {
  SE3 T_b_a;
  std::vector<Vector3> a, b;
};

/// Points at depth 4 to 8, or on a slanted plane; a fifth of the pairs are wrong.
Views random_views(std::mt19937& rng, const SE3& T_b_a, bool planar) {
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> noise(0, kNoise);
  Views views{T_b_a, {}, {}};
  for (int i = 0; i < 100; ++i) {
    const double x = 3 * unit(rng), y = 3 * unit(rng);
    const Vector3 x_a(x, y, planar ? 6 + 0.3 * x - 0.2 * y : 6 + 2 * unit(rng));
    const Vector3 x_b = i % 5 == 0 ? Vector3(3 * unit(rng), 3 * unit(rng), 6) : T_b_a * x_a;
    views.a.push_back(x_a / x_a.z() + Vector3(noise(rng), noise(rng), 0));
    views.b.push_back(x_b / x_b.z() + Vector3(noise(rng), noise(rng), 0));
  }
  return views;
}

RansacOptions options() {
  RansacOptions ransac;
  ransac.threshold = 4 * kNoise;
  return ransac;
}

TEST(ViewRotation, IsFoundAmongWrongPairs) {
  std::mt19937 rng(3);
  const SE3 T_b_a(SO3::exp(Vector3(0.1, -0.2, 0.05)), Vector3::Zero());
  const Views views = random_views(rng, T_b_a, false);
  const auto found = estimate_view_rotation(views.a, views.b, options());
  ASSERT_TRUE(found);
  EXPECT_GE(found->inliers.size(), 75u);
  EXPECT_LT((found->R_b_a.inverse() * T_b_a.so3()).log().norm(), 1e-3);
}

TEST(ViewRotation, DoesNotExplainACameraThatMoves) {
  std::mt19937 rng(4);
  const Views views = random_views(rng, SE3(SO3::exp(Vector3(0, 0.1, 0)), Vector3(0.5, 0, 0)), false);
  const auto found = estimate_view_rotation(views.a, views.b, options());
  ASSERT_TRUE(found);
  EXPECT_LT(found->inliers.size(), 40u);
}

TEST(Homography, ExplainsAPlaneAndHoldsItsMotion) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto random = [&] { return Vector3(unit(rng), unit(rng), unit(rng)); };
    const SE3 T_b_a(SO3::exp(0.1 * random()), random().normalized());
    const Views views = random_views(rng, T_b_a, true);
    const auto found = estimate_homography(views.a, views.b, options());
    ASSERT_TRUE(found);
    EXPECT_GE(found->inliers.size(), 70u);
    double nearest = 10;
    const auto any = static_cast<std::size_t>(found->inliers.front());
    for (const SE3& T : decompose_homography(found->H_b_a, views.a[any], views.b[any])) {
      EXPECT_NEAR(T.translation().norm(), 1, 1e-9);
      const double turned = (T.so3().inverse() * T_b_a.so3()).log().norm();
      nearest = std::min(nearest, turned + (T.translation() - T_b_a.translation()).norm());
    }
    EXPECT_LT(nearest, 0.05) << trial;
  }
}

TEST(Homography, OfARotationHoldsNoMotion) {
  EXPECT_TRUE(decompose_homography(SO3::exp(Vector3(0.1, 0.2, 0)).matrix(), {0, 0, 1}, {0, 0, 1}).empty());
}

TEST(Homography, OfInfiniteNumbersHoldsNoMotion) {
  const Matrix3 H = Matrix3::Constant(std::numeric_limits<double>::infinity());
  EXPECT_TRUE(decompose_homography(H, {0, 0, 1}, {0, 0, 1}).empty());
}

TEST(Homography, DoesNotExplainDepth) {
  std::mt19937 rng(6);
  const Views views = random_views(rng, SE3(SO3(), Vector3(0.8, 0, 0.2)), false);
  const auto found = estimate_homography(views.a, views.b, options());
  ASSERT_TRUE(found);
  EXPECT_LT(found->inliers.size(), 40u);
}

}  // namespace
}  // namespace twofold
