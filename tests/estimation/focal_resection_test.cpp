#include "estimation/focal_resection.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

constexpr std::size_t kPoints = 100;

Rig one_camera() {
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {320, 320, 319.5, 239.5, 640, 480};
  return rig;
}

/// Frames of a room whose points lie between `nearest` and `farthest`, each frame asked of a rig whose focal
/// length is `wrong` times the true one, from the pose that fits best with that.
std::optional<FocalLengthEstimate> resected(double wrong, unsigned seed, int frames, double nearest,
                                            double farthest) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> across(-1, 1), depth(nearest, farthest);
  const Rig rig = one_camera();
  Rig given = rig;
  given.camera.fx *= wrong;
  given.camera.fy *= wrong;
  const MotionOnlyOptions options{.max_iterations = 15, .inlier_chi2_mono = 9.21};
  FocalResection resection(given, kPoints, options);
  for (int n = 0; n < frames; ++n) {
    Vector6 motion;
    for (double& value : motion) value = 0.05 * normal(rng);
    const SE3 T_c_ref = SE3::exp(motion);
    std::vector<MotionObservation> observations;
    for (std::size_t k = 0; k < kPoints; ++k) {
      const double z = depth(rng);
      const Vector3 x_ref(0.8 * z * across(rng), 0.6 * z * across(rng), z);
      const Vector2 seen = rig.camera.project(T_c_ref * x_ref) + Vector2(normal(rng), normal(rng));
      observations.push_back(
          {x_ref, StereoPixel(seen.x(), seen.y(), Rig::kNoRight).cast<float>(), Eigen::Vector3f(1, 1, 0)});
    }
    const MotionOnlyResult given_pose = optimise_motion(given, observations, T_c_ref, options);
    const std::uint64_t before = testing::allocations();
    resection.add(observations, given_pose.T_c_ref);
    EXPECT_EQ(testing::allocations(), before) << "the tracker's thread asks it";
  }
  return resection.estimate();
}

TEST(FocalResection, FindsTheFocalLengthWhereTheRigsIsWrong) {
  for (const double wrong : {0.8, 0.95, 1.0, 1.05, 1.2}) {
    const auto estimate = resected(wrong, 1, 100, 2, 10);
    ASSERT_TRUE(estimate) << wrong;
    EXPECT_LT(estimate->sigma, 0.002) << wrong;
    EXPECT_NEAR(estimate->scale * wrong, 1, 4 * estimate->sigma) << wrong;
  }
}

/// Squares of errors in standard deviations: 40 of them have a mean of 1 +- 0.22.
TEST(FocalResection, IsAsExactAsItSays) {
  double sum = 0;
  constexpr unsigned kRooms = 40;
  for (unsigned seed = 1; seed <= kRooms; ++seed) {
    const auto estimate = resected(1.05, seed, 40, 2, 10);
    ASSERT_TRUE(estimate) << seed;
    sum += std::pow((estimate->scale * 1.05 - 1) / estimate->sigma, 2);
  }
  EXPECT_NEAR(sum / kRooms, 1, 3 * 0.22);
}

/// A longer focal length is the same as a wall that is nearer.
TEST(FocalResection, AWallAheadShowsItLessThanARoom) {
  const auto room = resected(1, 1, 40, 2, 10), wall = resected(1, 1, 40, 5, 5.01);
  ASSERT_TRUE(room && wall);
  EXPECT_GT(wall->sigma, 8 * room->sigma);
  EXPECT_NEAR(wall->scale, 1, 4 * wall->sigma);
}

TEST(FocalResection, AFewFramesShowNothing) {
  EXPECT_FALSE(resected(1.1, 1, 5, 2, 10));
  EXPECT_TRUE(resected(1.1, 1, 20, 2, 10));
}

}  // namespace
}  // namespace twofold
