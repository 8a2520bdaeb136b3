#include "estimation/pose_uncertainty.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
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
      observations_.push_back(observe_point(rig_, x, measured, 0));
    }
  }
  MotionOnlyResult solve() { return optimise_motion(rig_, observations_, SE3(), options_); }

  /// Mean over frames of the squared error of the pose, which should not move, over its covariance and 6.
  double nees(double own, double common) {
    PoseUncertainty uncertainty(rig_);
    double sum = 0;
    constexpr int kSettling = 40, kFrames = 240;
    for (int frame = 0; frame < kSettling + kFrames; ++frame) {
      make_frame(own, common);
      const MotionOnlyResult motion = solve();
      uncertainty.update(observations_, motion, options_, true);
      const Vector6 error = motion.T_c_ref.log();
      const Matrix6 covariance = uncertainty.covariance(motion.information);
      if (frame >= kSettling) sum += error.dot(covariance.ldlt().solve(error)) / 6 / kFrames;
    }
    return sum;
  }

  void make_far_frame() {
    std::uniform_real_distribution<double> u(5, 635), v(5, 475);
    std::normal_distribution<double> noise(0, 0.1);
    observations_.clear();
    for (int n = 0; n < 200; ++n) {
      // Braces: drawn from left to right by every compiler.
      const Vector3 x = rig_.camera.unproject(Vector2{u(random_), v(random_)}) * 60;
      const Vector3 z = rig_.project(x) + Vector3{noise(random_), noise(random_), noise(random_)};
      const Eigen::Vector3f measured = z.cast<float>();
      observations_.push_back(observe_point(rig_, x, measured, 0));
    }
  }

  /// Of the pose in this frame, which should not have moved, over its covariance and 6. The frame counts in a
  /// copy only.
  double squared_error(PoseUncertainty uncertainty, const MotionOnlyResult& motion) {
    uncertainty.update(observations_, motion, options_, true);
    const Vector6 error = motion.T_c_ref.log();
    return error.dot(uncertainty.covariance(motion.information).ldlt().solve(error)) / 6;
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
  PoseUncertainty uncertainty(rig_);
  const MotionOnlyResult motion = solve();
  uncertainty.update(observations_, motion, options_, true);
  EXPECT_EQ(uncertainty.variance_factor(), 1);
  const Matrix6 expected = motion.information.inverse();
  EXPECT_LT((uncertainty.covariance(motion.information) - expected).norm(), 1e-6 * expected.norm());
}

TEST_F(PoseUncertaintyTest, UpdatesAllocateNothing) {
  make_frame(0.3, 0);
  const MotionOnlyResult motion = solve();
  PoseUncertainty uncertainty(rig_);
  const auto before = testing::allocations();
  uncertainty.update(observations_, motion, options_, true);
  const Matrix6 covariance = uncertainty.covariance(motion.information);
  if (testing::allocations_are_counted()) {
    EXPECT_EQ(testing::allocations(), before);
  }
  EXPECT_GT(covariance.trace(), 0);
  EXPECT_TRUE(uncertainty.by_rows().allFinite());
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

/// Far points all over, and one that is near where it is not: alone it says where the camera is, and leaves
/// no residual that would tell. What a single frame says about itself varies a lot: from 0.4 to 220 in 500 of
/// them.
TEST_F(PoseUncertaintyTest, OnePointThatThePoseHangsOnDoesNotMakeItExact) {
  PoseUncertainty usual(rig_), without_own_part(rig_, {.of_frame = 0});
  for (int frame = 0; frame < 30; ++frame) {
    make_far_frame();
    usual.update(observations_, solve(), options_, true);
    without_own_part.update(observations_, solve(), options_, true);
  }
  std::vector<double> said;
  for (int frame = 0; frame < 41; ++frame) {
    make_far_frame();
    const Vector3 near(0.4, 0.2, 1.5), seen = near + Vector3(0.1, -0.05, 0);
    const Eigen::Vector3f z = rig_.project(seen).cast<float>();
    observations_.push_back(observe_point(rig_, near, z, 0));
    const MotionOnlyResult motion = solve();
    ASSERT_GT(motion.T_c_ref.translation().norm(), 0.05);
    said.push_back(squared_error(usual, motion));
    EXPECT_GT(squared_error(without_own_part, motion), 1000);
  }
  std::nth_element(said.begin(), said.begin() + 20, said.end());
  EXPECT_LT(said[20], 20);
}

/// A camera that turns and drives on while its rows are read, tracked as if it did not.
TEST_F(PoseUncertaintyTest, AnUnknownReadoutPushesThePoseAsFarAsItSays) {
  Vector6 velocity;
  velocity << 0.4, -0.2, 0.5, 0.6, 0.9, -0.7;
  constexpr double kReadout = 0.01;
  make_frame(0, 0);
  for (MotionObservation& o : observations_) {
    const double row = (o.pixel.y() + 0.5) / rig_.camera.height - 0.5;
    o.pixel = rig_.project(SE3::exp(row * kReadout * velocity) * o.x_ref).cast<float>();
  }
  const MotionOnlyResult motion = solve();
  PoseUncertainty uncertainty(rig_);
  uncertainty.update(observations_, motion, options_, true);
  const Vector6 force = kReadout * (uncertainty.by_rows() * velocity);
  const Vector6 said = motion.information.ldlt().solve(force);
  const Vector6 is = motion.T_c_ref.log();
  EXPECT_GT(is.norm(), 1e-3);
  EXPECT_LT((said - is).norm(), 0.1 * is.norm());
}

}  // namespace
}  // namespace twofold
