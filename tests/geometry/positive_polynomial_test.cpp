#include "geometry/positive_polynomial.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "geometry/real_roots.hpp"

namespace twofold {
namespace {

bool positive(double end, const std::vector<double>& coefficients) {
  return is_positive_to(end, coefficients);
}

TEST(PositivePolynomial, EndsWhereTheFirstRootIs) {
  EXPECT_TRUE(positive(0.999, {1, 0, -1}));
  EXPECT_FALSE(positive(1.001, {1, 0, -1}));
  EXPECT_FALSE(positive(100, {6, -11, 6, -1}));  // roots at 1, 2, 3
  EXPECT_FALSE(positive(2.5, {6, -11, 6, -1}));  // where it is positive again
  EXPECT_TRUE(positive(0, {1, -5}));
  EXPECT_FALSE(positive(0, {0, 5}));
  EXPECT_TRUE(positive(1e3, {2}));
}

/// (z - 1)^2 + gap: what halving is for.
TEST(PositivePolynomial, NearlyTouchesZero) {
  for (const double gap : {1e-2, 1e-6, 1e-12}) {
    EXPECT_TRUE(positive(3, {1 + gap, -2, 1})) << gap;
    EXPECT_FALSE(positive(3, {1 - gap, -2, 1})) << gap;
  }
  EXPECT_FALSE(positive(3, {1, -2, 1}));
}

TEST(PositivePolynomial, AgreesWithTheRealRoots) {
  std::mt19937 rng(6);
  std::uniform_real_distribution<double> unit(-1, 1);
  int positives = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<double> c{1};
    while (c.size() < 1 + static_cast<std::size_t>(trial % 9)) c.push_back(3 * unit(rng));
    const double end = 1 + unit(rng);
    std::array<double, 9> roots{};
    const int count = real_roots(c, roots);
    const bool none = std::none_of(roots.begin(), roots.begin() + count,
                                   [&](double root) { return root > 0 && root <= end; });
    EXPECT_EQ(positive(end, c), none) << "trial " << trial;
    positives += none ? 1 : 0;
  }
  EXPECT_GT(positives, 500);
  EXPECT_LT(positives, 1500);
}

TEST(PositivePolynomial, IsNotWhatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(positive(1, {1, nan, 1}));
  EXPECT_FALSE(positive(nan, {1, 1, 1}));
  EXPECT_FALSE(positive(1, {1, -inf, inf}));
  EXPECT_FALSE(positive(inf, {1, -1, 1}));
  EXPECT_FALSE(positive(1, {1, inf}));
  EXPECT_FALSE(positive(inf, {1, 1}));
}

}  // namespace
}  // namespace twofold
