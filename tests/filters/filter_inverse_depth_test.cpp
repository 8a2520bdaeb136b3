// Inverse depth filters of thesis 3.4.4.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "filters/inverse_depth_filter.hpp"
#include "tests/filters/filter_rig.hpp"

namespace twofold {
namespace {

using namespace testing;

TEST(FilterInverseDepth, ProjectionJacobiansAreCentralDifferences) {
  const Rig rig = make_rig(SensorKind::kStereo);
  std::mt19937 rng(1);
  std::normal_distribution<double> n(0, 1);
  for (int trial = 0; trial < 50; ++trial) {
    const SE3 T_c_w = SE3::exp(0.1 * Vector6::NullaryExpr([&] { return n(rng); }));
    const SE3 T_a_w = SE3::exp(0.1 * Vector6::NullaryExpr([&] { return n(rng); }));
    // A third of the points at infinity or beyond, where a depth would be none.
    const double inverse_depth = trial % 3 == 0 ? -0.1 * std::abs(n(rng)) * (trial % 2) : 0.3 + 0.1 * n(rng);
    const Vector3 psi(0.2 * n(rng), 0.2 * n(rng), inverse_depth);
    const auto p = project_inverse_depth(rig, T_c_w * T_a_w.inverse(), psi);
    ASSERT_TRUE(p);
    if (psi.z() > 0) {
      const Vector3 x_c = T_c_w * T_a_w.inverse() * from_inverse_depth(psi);
      EXPECT_LT((p->z_hat - rig.project(x_c)).norm(), 1e-9);
    }
    const auto at = [&](const SE3& c, const SE3& a, const Vector3& q) {
      return project_inverse_depth(rig, c * a.inverse(), q)->z_hat;
    };
    const double h = 1e-6;
    for (int i = 0; i < 6; ++i) {
      const SE3 up = SE3::exp(h * Vector6::Unit(i)), down = SE3::exp(-h * Vector6::Unit(i));
      const Vector3 camera = (at(up * T_c_w, T_a_w, psi) - at(down * T_c_w, T_a_w, psi)) / (2 * h);
      const Vector3 anchor = (at(T_c_w, up * T_a_w, psi) - at(T_c_w, down * T_a_w, psi)) / (2 * h);
      EXPECT_LT((camera - p->J_camera.col(i)).norm(), 1e-5 * (1 + camera.norm()));
      EXPECT_LT((anchor - p->J_anchor.col(i)).norm(), 1e-5 * (1 + anchor.norm()));
    }
    for (int i = 0; i < 3; ++i) {
      const Vector3 d = h * Vector3::Unit(i);
      const Vector3 point = (at(T_c_w, T_a_w, psi + d) - at(T_c_w, T_a_w, psi - d)) / (2 * h);
      EXPECT_LT((point - p->J_psi.col(i)).norm(), 1e-5 * (1 + point.norm()));
    }
  }
}

TEST(FilterInverseDepth, StereoStartIsTheInverseOfTheMeasurement) {
  const Rig rig = make_rig(SensorKind::kStereo);
  const Vector3 x(0.3, -0.2, 4);
  const auto filter = InverseDepthFilter::from_stereo(rig, rig.project(x), 0.5);
  EXPECT_LT((from_inverse_depth(filter.psi) - x).norm(), 1e-9);
  const auto p = project_inverse_depth(rig, SE3(), filter.psi);
  EXPECT_LT((filter.information - 4 * p->J_psi.transpose() * p->J_psi).norm(),
            1e-6 * filter.information.norm());
}

TEST(FilterInverseDepth, MonocularDepthGoesFromUnknownToConsistent) {
  const Rig rig = make_rig(SensorKind::kMono);
  std::mt19937 rng(2);
  std::normal_distribution<double> n(0, 0.5);
  double nees = 0;
  const int trials = 400;
  for (int trial = 0; trial < trials; ++trial) {
    const Vector3 x(0.1, 0.2, 5);
    const auto measured = [&](const SE3& T) {
      Vector3 z = rig.project(T * x) + Vector3(n(rng), n(rng), 0);
      z.z() = Rig::kNoRight;
      return z;
    };
    auto filter = InverseDepthFilter::from_mono(rig.camera, measured(SE3()).head<2>(), 0.5);
    EXPECT_TRUE(std::isinf(filter.inverse_depth_sigma()));
    double last = 1e9;
    for (const double shift : {0.2, 0.4, 0.6, 0.8}) {
      const SE3 T(SO3(), Vector3(-shift, 0, 0));
      ASSERT_TRUE(filter.update(rig, T, measured(T), 0.5));
      EXPECT_LT(filter.inverse_depth_sigma(), last);
      last = filter.inverse_depth_sigma();
    }
    const Vector3 e = filter.psi - to_inverse_depth(x);
    nees += e.dot(filter.information * e) / trials;
  }
  EXPECT_NEAR(nees, 3.0, 0.37);  // 99.7 % bound for 400 x 3 degrees of freedom
}

TEST(FilterInverseDepth, DepthStaysWhereItIsWithoutParallax) {
  const Rig rig = make_rig(SensorKind::kMono);
  auto filter = InverseDepthFilter::from_mono(rig.camera, Vector2(300, 200), 0.5);
  const SE3 T(SO3(), Vector3(3e-16, 0, 0));  // what rounding leaves of no motion
  EXPECT_TRUE(filter.update(rig, T, Vector3(300.7, 199.6, Rig::kNoRight), 0.5));
  EXPECT_NEAR(filter.psi.z(), 1, 1e-4);
  EXPECT_GT(filter.inverse_depth_sigma(), 1e9);
}

TEST(FilterInverseDepth, BehindTheCameraIsRefused) {
  const Rig rig = make_rig(SensorKind::kMono);
  auto filter = InverseDepthFilter::from_mono(rig.camera, Vector2(300, 200), 0.5);
  const SE3 T(SO3(), Vector3(0, 0, -3));  // the point, started at 1 m, lies behind
  const Vector3 before = filter.psi;
  EXPECT_FALSE(filter.update(rig, T, Vector3(300, 200, Rig::kNoRight), 0.5));
  EXPECT_EQ((filter.psi - before).norm(), 0.0);
}

}  // namespace
}  // namespace twofold
