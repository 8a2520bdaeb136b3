#include "estimation/motion_only.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>

#include "camera/measurement.hpp"
#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

struct Scene {
  Rig rig;
  SE3 T_c_ref;
  std::vector<MotionObservation> observations;
  std::vector<bool> is_outlier;
};

Scene make_scene(int count, double noise, double outliers, double missing_right, unsigned seed = 1) {
  Scene scene;
  scene.rig.camera = {420, 425, 319.5, 239.5, 640, 480};
  scene.rig.baseline = 0.12;
  std::mt19937 rng(seed);
  std::uniform_real_distribution<double> uniform(-1, 1), share(0, 1);
  std::normal_distribution<double> normal;
  Vector6 motion;
  motion << 0.1, -0.05, 0.2, 0.03, -0.05, 0.02;
  scene.T_c_ref = SE3::exp(motion);
  for (int n = 0; n < count; ++n) {
    MotionObservation o;
    o.x_ref = Vector3(2.5 * uniform(rng), 2 * uniform(rng), 5 + 3 * uniform(rng));
    Vector3 z = scene.rig.project(scene.T_c_ref * o.x_ref);
    z += noise * Vector3(normal(rng), normal(rng), normal(rng));
    scene.is_outlier.push_back(share(rng) < outliers);
    if (scene.is_outlier.back()) z += Vector3(30 + 30 * uniform(rng), -25 + 20 * uniform(rng), 30);
    o.pixel = z.cast<float>();
    if (noise > 0) o.information.setConstant(static_cast<float>(1 / (noise * noise)));
    if (share(rng) < missing_right) {
      o.information.z() = 0;
      o.pixel.z() = std::nanf("");
    }
    scene.observations.push_back(o);
  }
  return scene;
}

TEST(MotionOnly, APointsMeasurementWeighsAsTheRigsNoiseSays) {
  Rig rig;
  rig.noise.sigma_px = 0.7;
  const Eigen::Vector3f z(300, 200, 290);
  const MotionObservation fine = observe_point(rig, {1, 2, 3}, z, 0),
                          coarse = observe_point(rig, {1, 2, 3}, z, 2);
  EXPECT_EQ(fine.x_ref, Vector3(1, 2, 3));
  EXPECT_EQ(fine.pixel, z);
  EXPECT_TRUE(fine.inlier);
  EXPECT_TRUE(fine.information.isApprox(Eigen::Vector3f::Constant(1 / 0.49F)));
  EXPECT_TRUE(coarse.information.isApprox(fine.information / 16));
  const MotionObservation left = observe_point(rig, {1, 2, 3}, {300, 200, std::nanf("")}, 0);
  EXPECT_EQ(left.information.x(), fine.information.x());
  EXPECT_EQ(left.information.z(), 0);
}

TEST(MotionOnly, FindsTruthForAnyCount) {
  for (const int count : {3, 4, 5, 7, 8, 50, 201}) {
    for (const double missing_right : {0.0, 0.5, 1.0}) {
      if (count < 5 && missing_right > 0) continue;  // three directions have four solutions
      Scene scene = make_scene(count, 0, 0, missing_right);
      MotionOnlyOptions options;
      options.max_iterations = 30;
      const auto result = optimise_motion(scene.rig, scene.observations, SE3(), options);
      EXPECT_TRUE(result.converged) << count;
      EXPECT_EQ(result.inliers, count);
      // Measurements are floats: about 3e-5 px at 640 px.
      EXPECT_LT((result.T_c_ref * scene.T_c_ref.inverse()).log().norm(), 1e-4) << count;
    }
  }
}

TEST(MotionOnly, SetsOutliersAside) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    Scene scene = make_scene(200, 0.5, 0.2, 0.3, seed);
    const auto result = optimise_motion(scene.rig, scene.observations, SE3(), {});
    EXPECT_TRUE(result.converged);
    EXPECT_LT((result.T_c_ref * scene.T_c_ref.inverse()).log().norm(), 0.01) << "seed " << seed;
    int kept = 0, clean = 0;
    for (std::size_t n = 0; n < scene.observations.size(); ++n) {
      if (scene.is_outlier[n]) {
        EXPECT_FALSE(scene.observations[n].inlier);
      } else {
        ++clean;
        kept += scene.observations[n].inlier;
      }
    }
    EXPECT_GT(kept, 0.85 * clean);  // 95 % are expected
    EXPECT_EQ(kept, result.inliers);
  }
}

/// Over many draws of the noise the error, whitened by the information returned, has six degrees of freedom.
TEST(MotionOnly, InformationPredictsTheError) {
  double sum = 0;
  constexpr int kDraws = 400;
  MotionOnlyOptions options;
  options.huber_sigmas = 0;
  options.inlier_chi2_mono = options.inlier_chi2_stereo = 1e9;
  for (unsigned seed = 1; seed <= kDraws; ++seed) {
    Scene scene = make_scene(60, 0.8, 0, 0.3, seed);
    const auto result = optimise_motion(scene.rig, scene.observations, SE3(), options);
    const Vector6 error = (result.T_c_ref * scene.T_c_ref.inverse()).log();
    sum += error.dot(result.information * error);
  }
  EXPECT_NEAR(sum / kDraws, 6.0, 0.6);  // standard deviation of the mean: sqrt(12 / 400) = 0.17
}

TEST(MotionOnly, GradientVanishesAndInformationIsTheCurvature) {
  Scene scene = make_scene(100, 1, 0, 0.3);
  MotionOnlyOptions options;
  options.huber_sigmas = 0;
  options.rounds = 1;
  options.max_iterations = 50;
  options.inlier_chi2_mono = options.inlier_chi2_stereo = 1e9;
  const auto result = optimise_motion(scene.rig, scene.observations, SE3(), options);
  const auto residuals = [&](const SE3& T) {
    Eigen::VectorXd r(3 * 100);
    for (int n = 0; n < 100; ++n) {
      const auto& o = scene.observations[n];
      Vector3 e = scene.rig.project(T * o.x_ref) - o.pixel.cast<double>();
      if (!weighs_right(o.information)) e.z() = 0;
      r.segment<3>(3 * n) = o.information.cast<double>().cwiseSqrt().cwiseProduct(e);
    }
    return r;
  };
  Eigen::MatrixXd J(300, 6);
  for (int c = 0; c < 6; ++c) {
    J.col(c) = (residuals(SE3::exp(1e-6 * Vector6::Unit(c)) * result.T_c_ref) -
                residuals(SE3::exp(-1e-6 * Vector6::Unit(c)) * result.T_c_ref)) /
               2e-6;
  }
  const Matrix6 expected = J.transpose() * J;
  EXPECT_LT((result.information - expected).norm(), 1e-6 * expected.norm());
  const Eigen::VectorXd r = residuals(result.T_c_ref);
  EXPECT_LT((J.transpose() * r).norm(), 1e-3 * J.norm());
  EXPECT_NEAR(result.chi2, r.squaredNorm(), 1e-9 * r.squaredNorm());
}

TEST(MotionOnly, ReportsFailureAndKeepsTheStart) {
  Scene scene = make_scene(2, 0, 0, 0);
  const SE3 start = SE3::exp(0.01 * Vector6::Ones());
  auto result = optimise_motion(scene.rig, scene.observations, start, {});
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(result.determined);
  EXPECT_EQ(result.T_c_ref.matrix(), start.matrix());

  Scene all_equal = make_scene(1, 0, 0, 1);  // one direction five times: rank two
  all_equal.observations.assign(5, all_equal.observations[0]);
  result = optimise_motion(all_equal.rig, all_equal.observations, start, {});
  EXPECT_FALSE(result.converged);
  EXPECT_FALSE(result.determined) << result.inliers << " inliers";
  EXPECT_EQ(result.T_c_ref.matrix(), start.matrix());

  std::vector<MotionObservation> none;
  result = optimise_motion(scene.rig, none, start, {});
  EXPECT_FALSE(result.converged);
  EXPECT_EQ(result.inliers, 0);
}

TEST(MotionOnly, PointsBehindTheCameraDoNotPull) {
  Scene scene = make_scene(60, 0, 0, 0);
  for (int n = 0; n < 10; ++n) {
    MotionObservation behind;
    behind.x_ref = Vector3(0.1 * n, 0, -2);
    behind.pixel = Eigen::Vector3f(320, 240, 310);
    scene.observations.insert(scene.observations.begin() + 5 * n, behind);
  }
  const auto result = optimise_motion(scene.rig, scene.observations, SE3(), {});
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.inliers, 60);
  EXPECT_LT((result.T_c_ref * scene.T_c_ref.inverse()).log().norm(), 1e-5);
}

TEST(MotionOnly, AllocatesNothing) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "a sanitizer has its own allocator";
  Scene scene = make_scene(200, 0.5, 0.2, 0.3);
  const SE3 start;
  const MotionOnlyOptions options;
  const std::uint64_t before = testing::allocations();
  const auto result = optimise_motion(scene.rig, scene.observations, start, options);
  EXPECT_EQ(testing::allocations() - before, 0U);
  EXPECT_TRUE(result.converged);
  EXPECT_GT(before, 0U) << "the counter does not count";
}

TEST(MotionOnly, IsDeterministic) {
  Scene a = make_scene(203, 0.5, 0.2, 0.3), b = a;
  const auto result_a = optimise_motion(a.rig, a.observations, SE3(), {});
  const auto result_b = optimise_motion(b.rig, b.observations, SE3(), {});
  EXPECT_EQ(result_a.T_c_ref.matrix(), result_b.T_c_ref.matrix());
  EXPECT_EQ(result_a.information, result_b.information);
}

}  // namespace
}  // namespace twofold
