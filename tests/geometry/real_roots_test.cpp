#include "geometry/real_roots.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace twofold {
namespace {

std::vector<double> roots_of(const std::vector<double>& coefficients) {
  std::vector<double> roots(coefficients.size());
  roots.resize(static_cast<std::size_t>(real_roots(coefficients, roots)));
  std::sort(roots.begin(), roots.end());
  return roots;
}

/// Product of (z - root) and of (z^2 + b^2).
std::vector<double> polynomial(const std::vector<double>& real, const std::vector<double>& imaginary = {}) {
  std::vector<double> c{1};
  const auto times = [&c](const std::vector<double>& factor) {
    std::vector<double> product(c.size() + factor.size() - 1, 0.0);
    for (std::size_t i = 0; i < c.size(); ++i) {
      for (std::size_t j = 0; j < factor.size(); ++j) product[i + j] += c[i] * factor[j];
    }
    c = product;
  };
  for (const double root : real) times({-root, 1});
  for (const double b : imaginary) times({b * b, 0, 1});
  return c;
}

TEST(RealRoots, FindsAllOfThemAmongComplexOnes) {
  std::mt19937 rng(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<double> truth;
    const int count = trial % 7;
    for (int k = 0; k < count; ++k) truth.push_back(std::pow(10, unit(rng)) * (unit(rng) < 0 ? -1 : 1));
    std::sort(truth.begin(), truth.end());
    bool apart = true;
    for (int k = 1; k < count; ++k) apart = apart && truth[k] - truth[k - 1] > 0.05 * std::abs(truth[k]);
    if (!apart) continue;
    const std::vector<double> found = roots_of(polynomial(truth, {0.3 + std::abs(unit(rng)), 2}));
    ASSERT_EQ(found.size(), truth.size());
    for (int k = 0; k < count; ++k) EXPECT_NEAR(found[k], truth[k], 1e-7 * std::abs(truth[k]));
  }
}

TEST(RealRoots, TakesOneInOneIntervalAndAtItsEnds) {
  EXPECT_EQ(roots_of({-6, 11, -6, 1}).size(), 3u);  // 1, 2, 3
  const std::vector<double> ends = roots_of({-1, 0, 1});
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_NEAR(ends[0], -1, 1e-15);
  EXPECT_NEAR(ends[1], 1, 1e-15);
  const std::vector<double> zero = roots_of({0, 2, 1});
  ASSERT_EQ(zero.size(), 2u);
  EXPECT_NEAR(zero[0], -2, 1e-15);
  EXPECT_NEAR(zero[1], 0, 1e-15);
}

TEST(RealRoots, FarAndNearOnesKeepTheirDigits) {
  const std::vector<double> found = roots_of(polynomial({-3e4, 1e-4, 2e5}));
  ASSERT_EQ(found.size(), 3u);
  EXPECT_NEAR(found[0] / -3e4, 1, 1e-12);
  EXPECT_NEAR(found[1] / 1e-4, 1, 1e-8);
  EXPECT_NEAR(found[2] / 2e5, 1, 1e-12);
}

TEST(RealRoots, OfNothingAreNone) {
  EXPECT_TRUE(roots_of({4}).empty());
  EXPECT_TRUE(roots_of({0, 0, 0}).empty());
  EXPECT_TRUE(roots_of({1, 0, 1}).empty());
  EXPECT_TRUE(roots_of({1, std::numeric_limits<double>::quiet_NaN(), 1}).empty());
  const std::vector<double> lower = roots_of({-2, 1, 0, 0});  // leading coefficients of zero
  ASSERT_EQ(lower.size(), 1u);
  EXPECT_NEAR(lower[0], 2, 1e-15);
}

}  // namespace
}  // namespace twofold
