#include "estimation/pose_uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <random>
#include <vector>

#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

/// Frames of points all over the image, measured with errors of which the rig knows nothing.
class PoseUncertaintyTest : public ::testing::Test {
 protected:
  PoseUncertaintyTest() {
    rig_.camera = {420, 425, 319.5, 239.5, 640, 480};
    rig_.baseline = 0.12;
    options_.huber_sigmas = 0;
    options_.inlier_chi2_mono = options_.inlier_chi2_stereo = 1e6;
  }

  /// @param own     standard deviation of each measurement [px]
  /// @param common  of what all measurements in one of 6 x 4 parts of the image share [px]
  void make_frame(double own, double common) {
    std::uniform_real_distribution<double> u(5, 635), v(5, 475), depth(2, 9);
    std::normal_distribution<double> normal;
    Vector3 shared[4][6];
    for (auto& row : shared) {
      for (Vector3& error : row) error = common * Vector3(normal(random_), normal(random_), normal(random_));
    }
    observations_.clear();
    for (int n = 0; n < 200; ++n) {
      const Vector3 x = rig_.camera.unproject(Vector2(u(random_), v(random_))) * depth(random_);
      Vector3 z = rig_.project(x);
      const Vector3& error = shared[static_cast<int>(z.y()) / 120][static_cast<int>(z.x() * 6) / 640];
      z += error + own * Vector3(normal(random_), normal(random_), normal(random_));
      const Eigen::Vector3f measured = z.cast<float>();
      observations_.push_back({x, measured, rig_.information(measured, 0)});
    }
  }
  MotionOnlyResult solve() { return optimise_motion(rig_, observations_, SE3(), options_); }

  /// Mean over frames of the squared error of the pose, which should not move, over its covariance and 6.
  double nees(double own, double common) {
    VarianceFactor factor;
    double sum = 0;
    constexpr int kSettling = 40, kFrames = 240;
    for (int frame = 0; frame < kSettling + kFrames; ++frame) {
      make_frame(own, common);
      const MotionOnlyResult motion = solve();
      factor.update(rig_, observations_, motion, options_);
      const Vector6 error = motion.T_c_ref.log();
      const Matrix6 information = information_under(motion.information, factor.value(), Vector6::Zero());
      if (frame >= kSettling) sum += error.dot(information * error) / 6 / kFrames;
    }
    return sum;
  }

  Rig rig_;
  MotionOnlyOptions options_;
  std::mt19937 random_{5};
  std::vector<MotionObservation> observations_;
};

TEST_F(PoseUncertaintyTest, ResidualsTellTheNoiseThatTheRigDoesNotKnow) {
  for (const double noise : {0.1, 0.5, 2.0}) EXPECT_NEAR(nees(noise, 0), 1, 0.25) << noise;
}

TEST_F(PoseUncertaintyTest, WhatRegionsShareDoesNotAverageOut) {
  EXPECT_NEAR(nees(0.2, 0.4), 1, 0.45);
}

TEST_F(PoseUncertaintyTest, FewRegionsSayNothing) {
  make_frame(0.01, 0);
  observations_.resize(9);
  VarianceFactor factor;
  factor.update(rig_, observations_, solve(), options_);
  EXPECT_EQ(factor.value(), 1);
}

TEST_F(PoseUncertaintyTest, UpdatesAllocateNothing) {
  make_frame(0.3, 0);
  const MotionOnlyResult motion = solve();
  VarianceFactor factor;
  const auto before = testing::allocations();
  factor.update(rig_, observations_, motion, options_);
  const Vector6 force = readout_force(rig_, observations_, motion, Vector6::Ones(), options_);
  const Matrix6 information = information_under(motion.information, factor.value(), force);
  if (testing::allocations_are_counted()) {
    EXPECT_EQ(testing::allocations(), before);
  }
  EXPECT_GT(information.trace(), 0);
}

TEST_F(PoseUncertaintyTest, APoseFromSomeMeasurementsDiffersByWhatTheyLack) {
  double mean = 0;
  constexpr int kFrames = 300;
  for (int frame = 0; frame < kFrames; ++frame) {
    make_frame(0.5, 0);
    const MotionOnlyResult all = solve();
    observations_.resize(60);
    const MotionOnlyResult some = solve();
    const auto factor =
        split_factor(all.information, some.information, (all.T_c_ref * some.T_c_ref.inverse()).log());
    ASSERT_TRUE(factor);
    mean += *factor / kFrames;
  }
  EXPECT_NEAR(mean, 1, 0.15);
  EXPECT_FALSE(split_factor(Matrix6::Identity(), 2 * Matrix6::Identity(), Vector6::Ones()));
}

TEST_F(PoseUncertaintyTest, InformationUnderAForceIsTheInverseOfTheSum) {
  make_frame(0.5, 0);
  const Matrix6 information = solve().information;
  Vector6 push;
  push << 0.02, -0.01, 0.03, 0.01, 0.02, -0.01;
  const Matrix6 covariance = 3 * information.inverse() + push * push.transpose();
  const Matrix6 expected = covariance.inverse();
  EXPECT_LT((information_under(information, 3, information * push) - expected).norm(),
            1e-6 * expected.norm());
}

/// A camera that turns and drives on while its rows are read, tracked as if it did not.
TEST_F(PoseUncertaintyTest, AnUnknownReadoutPushesThePoseAsFarAsItSays) {
  Vector6 velocity;
  velocity << 0.4, -0.2, 0.5, 0.6, 0.9, -0.7;
  constexpr double kReadout = 0.01;
  make_frame(0, 0);
  for (MotionObservation& o : observations_) {
    const double row = (o.z.y() + 0.5) / rig_.camera.height - 0.5;
    o.z = rig_.project(SE3::exp(row * kReadout * velocity) * o.x_ref).cast<float>();
  }
  const MotionOnlyResult motion = solve();
  const Vector6 force = kReadout * readout_force(rig_, observations_, motion, velocity, options_);
  const Vector6 said = motion.information.ldlt().solve(force);
  const Vector6 is = motion.T_c_ref.log();
  EXPECT_GT(is.norm(), 1e-3);
  EXPECT_LT((said - is).norm(), 0.1 * is.norm());
}

}  // namespace
}  // namespace twofold
