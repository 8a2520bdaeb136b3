#include "fixtures/pose_consistency.hpp"

#include <gtest/gtest.h>

#include <random>

namespace twofold {
namespace {

/// A camera that drives and turns, 100 true poses a second.
SE3 T_w_c_at(double t) {
  Vector6 xi;
  xi << 0.5 * t, 0.1 * std::sin(3 * t), 0, 0.2 * std::sin(2 * t), 0.8 * t, 0.1 * t;
  return SE3::exp(xi);
}

class PoseConsistencyTest : public ::testing::Test {
 protected:
  /// Mean squared error of estimates with this error each [m, rad], and time stamps late by chance [s].
  double mean(const TruthNoise& truth_noise, const TruthNoise& known, double error, double clock) {
    std::normal_distribution<double> normal;
    const auto noise = [&](double m, double rad) {
      Vector6 xi;
      for (int i = 0; i < 6; ++i) xi[i] = (i < 3 ? m : rad) * normal(random_);
      return SE3::exp(xi);
    };
    Trajectory truth;
    for (int i = 0; i < 400; ++i)
      truth.push_back(
          {i * 10'000'000LL, T_w_c_at(0.01 * i) * noise(truth_noise.position, truth_noise.rotation)});
    const RelativeTruth relative(truth, known);
    double sum = 0;
    int count = 0;
    for (int i = 20; i < 380; ++i) {
      const double t_ref = 0.01 * (i - 5) + clock * normal(random_), t = 0.01 * i + clock * normal(random_);
      const SE3 estimate = noise(error, error) * T_w_c_at(t).inverse() * T_w_c_at(t_ref);
      const auto comparison = relative.compare(estimate, i * 10'000'000LL, (i - 5) * 10'000'000LL);
      EXPECT_TRUE(comparison);
      sum += comparison->normalised(error * error * Matrix6::Identity());
      ++count;
    }
    return sum / count;
  }
  std::mt19937 random_{2};
};

TEST_F(PoseConsistencyTest, IsOneWhereErrorsAreWhatTheirCovarianceSays) {
  EXPECT_NEAR(mean({}, {}, 0.002, 0), 1, 0.15);
}

TEST_F(PoseConsistencyTest, TheTruthMayErr) {
  const TruthNoise noise{0.004, 0.003, 0};
  EXPECT_NEAR(mean(noise, noise, 0.002, 0), 1, 0.2);
  EXPECT_GT(mean(noise, {}, 0.002, 0), 4);
}

TEST_F(PoseConsistencyTest, ClocksMayErr) {
  EXPECT_NEAR(mean({}, {0, 0, 0.01}, 0.002, 0.01), 1, 0.25);
  EXPECT_GT(mean({}, {}, 0.002, 0.01), 3);
}

TEST_F(PoseConsistencyTest, NothingIsSaidWhereNothingIsKnown) {
  const RelativeTruth truth({{0, SE3()}, {100'000'000, SE3()}, {900'000'000, SE3()}}, {});
  EXPECT_TRUE(truth.compare(SE3(), 50'000'000, 0));
  EXPECT_FALSE(truth.compare(SE3(), 500'000'000, 0));
  EXPECT_FALSE(truth.compare(SE3(), 950'000'000, 0));
}

}  // namespace
}  // namespace twofold
