#include "geometry/ransac.hpp"

#include <gtest/gtest.h>

#include <array>
#include <set>
#include <vector>

namespace twofold {
namespace {

struct Line {
  double slope, offset;
};

struct LineEstimator {
  using Model = Line;
  static constexpr int kSampleSize = 2;
  std::vector<double> x, y;
  [[nodiscard]] int size() const { return static_cast<int>(x.size()); }
  void fit(std::span<const int, 2> s, std::vector<Line>& models) const {
    if (x[s[0]] == x[s[1]]) return;
    const double slope = (y[s[1]] - y[s[0]]) / (x[s[1]] - x[s[0]]);
    models.push_back({slope, y[s[0]] - slope * x[s[0]]});
  }
  [[nodiscard]] double squared_residual(const Line& l, int i) const {
    const double r = y[i] - l.slope * x[i] - l.offset;
    return r * r;
  }
};

/// Points on y = 2 x + 1 at even indices, noise of a wide range at odd ones.
LineEstimator half_outliers(int n) {
  LineEstimator e;
  SplitMix64 random(8);
  for (int i = 0; i < n; ++i) {
    e.x.push_back(i);
    e.y.push_back(i % 2 == 0 ? 2 * i + 1 + 1e-3 * random.below(3) : random.below(100000) - 50000);
  }
  return e;
}

TEST(Ransac, FindsTheInliersAmongHalfOutliers) {
  const auto e = half_outliers(200);
  const auto result = ransac(e, {.threshold = 0.01, .confidence = 0.9999});
  ASSERT_TRUE(result);
  EXPECT_NEAR(result->model.slope, 2, 1e-3);
  ASSERT_EQ(result->inliers.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(result->inliers[i], 2 * i);
}

TEST(Ransac, StopsEarlyWhenThereAreFewOutliers) {
  auto e = half_outliers(200);
  EXPECT_LT(ransac(e, {.threshold = 0.01, .max_iterations = 100000})->iterations, 200);
  for (int i = 1; i < 200; i += 2) e.y[i] = 2 * i + 1;
  EXPECT_LE(ransac(e, {.threshold = 0.01, .max_iterations = 100000})->iterations, 2);
}

TEST(Ransac, RepeatsItselfAndObeysTheSeed) {
  const auto e = half_outliers(100);
  const auto a = ransac(e, {.threshold = 0.01, .seed = 7});
  const auto b = ransac(e, {.threshold = 0.01, .seed = 7});
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->model.slope, b->model.slope);
  EXPECT_EQ(a->iterations, b->iterations);
}

TEST(Ransac, ReturnsNothingWhenNothingFits) {
  LineEstimator e;
  EXPECT_FALSE(ransac(e, {.threshold = 1}));
  e.x = {1, 1, 1};
  e.y = {0, 5, 9};
  EXPECT_FALSE(ransac(e, {.threshold = 1, .max_iterations = 20}));
}

TEST(Ransac, TriesTheSamplesThatItIsGivenAndNoOthers) {
  const auto e = half_outliers(200);
  const std::vector<std::array<int, 2>> mixed{{0, 1}, {3, 5}, {4, 7}};
  const std::vector<std::array<int, 2>> with_a_right_one{{0, 1}, {10, 190}, {3, 5}};
  const auto found = best_of_samples(e, std::span(with_a_right_one), 0.01);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->model.slope, 2, 1e-3);
  EXPECT_EQ(found->inliers.size(), 100U);
  const auto best_of_mixed = best_of_samples(e, std::span(mixed), 0.01);
  EXPECT_TRUE(!best_of_mixed || best_of_mixed->inliers.size() < 10);
  EXPECT_FALSE(best_of_samples(e, std::span(mixed).first(0), 0.01));
}

TEST(SplitMix64, CoversItsRange) {
  SplitMix64 random(1);
  std::vector<int> count(7, 0);
  for (int i = 0; i < 70000; ++i) ++count.at(random.below(7));
  for (const int c : count) EXPECT_NEAR(c, 10000, 500);
}

}  // namespace
}  // namespace twofold
