#include "estimation/region_sums.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <random>
#include <vector>

namespace twofold {
namespace {

/// Linear measurements of a pose, a unit of noise each, at the pose that fits them best.
class RegionSumsTest : public ::testing::Test {
 protected:
  static constexpr int kColumns = 6, kRows = 4, kRegions = kColumns * kRows;
  static Eigen::Vector2f centre_of(int region) {
    return {(static_cast<float>(region % kColumns) + 0.5F) * 640 / kColumns,
            (static_cast<float>(region / kColumns) + 0.5F) * 480 / kRows};
  }

  struct Measurement {
    int region;
    Vector6 J;
    double error;
  };
  /// @param shared  all measurements in a region say the same thing, and err alike
  void measure(int regions, int in_each, bool shared) {
    std::normal_distribution<double> normal;
    const auto measured = [&](int region) {
      Measurement m{region, {}, normal(random_)};
      for (double& value : m.J) value = normal(random_);
      return m;
    };
    measurements_.clear();
    for (int region = 0; region < regions; ++region) {
      const Measurement of_all = measured(region);
      for (int n = 0; n < in_each; ++n) measurements_.push_back(shared ? of_all : measured(region));
    }
  }
  /// Sums up what is left of the errors where they are least.
  void sum_up() {
    information_.setZero();
    Vector6 g = Vector6::Zero();
    for (const Measurement& m : measurements_) {
      information_ += m.J * m.J.transpose();
      g += m.J * m.error;
    }
    const Vector6 moved = information_.ldlt().solve(g);
    sums_.clear();
    for (const Measurement& m : measurements_)
      sums_.add(centre_of(m.region), m.J * m.J.transpose(), m.J * (m.error - m.J.dot(moved)));
  }
  /// Over many sets of measurements.
  double mean_factor(int in_each, bool shared) {
    double sum = 0;
    constexpr int kTrials = 400;
    for (int trial = 0; trial < kTrials; ++trial) {
      measure(kRegions, in_each, shared);
      sum_up();
      sum += sums_.variance_factor(information_).value_or(0) / kTrials;
    }
    return sum;
  }

  std::mt19937 random_{5};
  std::vector<Measurement> measurements_;
  RegionSums sums_{{400, 400, 320, 240, 640, 480}};
  Matrix6 information_;
};

/// Regions that all say the same of the pose lose one of them to it; six are assumed.
TEST_F(RegionSumsTest, IndependentErrorsMakeNoLargeFactor) {
  EXPECT_NEAR(mean_factor(20, false), (kRegions - 1.0) / (kRegions - 6), 0.05);
}

/// Here each says something else.
TEST_F(RegionSumsTest, ErrorsThatARegionSharesCountAsOften) {
  EXPECT_NEAR(mean_factor(20, true) / 20, 1, 0.35);
}

TEST_F(RegionSumsTest, FewRegionsSayNothing) {
  measure(11, 20, false);
  sum_up();
  EXPECT_FALSE(sums_.variance_factor(information_));
  EXPECT_FALSE(sums_.jackknife(information_));
  measure(12, 20, false);
  sum_up();
  EXPECT_TRUE(sums_.variance_factor(information_));
  EXPECT_TRUE(sums_.jackknife(information_));
  sums_.clear();
  EXPECT_FALSE(sums_.variance_factor(information_));
}

TEST_F(RegionSumsTest, ASingularInformationSaysNothing) {
  measure(kRegions, 20, false);
  for (Measurement& m : measurements_) m.J[5] = 0;
  sum_up();
  EXPECT_FALSE(sums_.variance_factor(information_));
}

TEST_F(RegionSumsTest, TheJackknifeIsTheCovarianceOfIndependentErrors) {
  double sum = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    measure(kRegions, 20, false);
    sum_up();
    sum += (sums_.jackknife(information_).value() * information_).trace() / 6 / kTrials;
  }
  EXPECT_NEAR(sum, 1, 0.15);
}

/// One measurement alone says of a direction what little is known of it: its residual is hardly anything.
TEST_F(RegionSumsTest, TheJackknifeShowsWhatHangsOnOneRegion) {
  measure(kRegions, 20, false);
  for (Measurement& m : measurements_) m.J[5] *= 0.01;
  Measurement& alone = measurements_[0];
  alone.J = 10 * Vector6::Unit(5);
  alone.error = 10;
  sum_up();
  const double claimed = information_.inverse()(5, 5);
  EXPECT_GT(sums_.jackknife(information_).value()(5, 5), 50 * claimed);
  EXPECT_LT(sums_.variance_factor(information_).value(), 5);
}

TEST_F(RegionSumsTest, RowsAreWeighedByTheirDistanceFromTheMiddle) {
  const Matrix6 unit = Matrix6::Identity();
  sums_.add({100, 239.5F}, unit, Vector6::Zero());
  EXPECT_NEAR(sums_.by_rows().norm(), 0, 1e-6);
  sums_.add({100, -0.5F}, unit, Vector6::Zero());
  EXPECT_NEAR(sums_.by_rows()(3, 3), -0.5, 1e-6);
  sums_.clear();
  sums_.add({600, 359.5F}, unit, Vector6::Zero());
  EXPECT_NEAR(sums_.by_rows()(3, 3), 0.25, 1e-6);
}

}  // namespace
}  // namespace twofold
