#include "tracking/common/quadtree.hpp"

#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <random>
#include <set>
#include <vector>

namespace twofold {
namespace {

constexpr int kWidth = 640;
constexpr int kHeight = 480;

/// Most points crowd in one corner of the image, a few are spread over the rest.
std::vector<Eigen::Vector2f> crowded(std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<Eigen::Vector2f> points;
  for (int i = 0; i < 900; ++i) points.emplace_back(80 * unit(random), 60 * unit(random));
  for (int i = 0; i < 100; ++i) points.emplace_back(639 * unit(random), 479 * unit(random));
  return points;
}

std::vector<std::int64_t> order(Quadtree& tree, const std::vector<Eigen::Vector2f>& points) {
  tree.clear();
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_TRUE(tree.insert(points[i], static_cast<std::uint32_t>(i)));
  }
  std::vector<std::int64_t> result;
  for (std::int64_t i = tree.next(); i >= 0; i = tree.next()) result.push_back(i);
  return result;
}

TEST(Quadtree, ReturnsEveryPointOnce) {
  Quadtree tree(kWidth, kHeight, 1000);
  const auto points = crowded(1);
  const auto result = order(tree, points);
  EXPECT_EQ(result.size(), points.size());
  EXPECT_EQ(std::set<std::int64_t>(result.begin(), result.end()).size(), points.size());
  EXPECT_EQ(tree.next(), -1);
}

TEST(Quadtree, PointsAtTheSamePlaceAreNotLost) {
  Quadtree tree(kWidth, kHeight, 100);
  const std::vector<Eigen::Vector2f> points(60, Eigen::Vector2f(320.5F, 100));
  EXPECT_EQ(order(tree, points).size(), points.size());
}

TEST(Quadtree, FirstPointsCoverTheImageWhereverTheCrowdIs) {
  Quadtree tree(kWidth, kHeight, 1000);
  double in_crowd = 0;
  double cells = 0;
  constexpr int kTrials = 20;
  constexpr int kFirst = 60;
  for (std::uint32_t seed = 0; seed < kTrials; ++seed) {
    const auto points = crowded(seed);
    const auto result = order(tree, points);
    std::set<int> met;
    for (int i = 0; i < kFirst; ++i) {
      const Eigen::Vector2f& uv = points[static_cast<std::size_t>(result[static_cast<std::size_t>(i)])];
      met.insert(static_cast<int>(uv.x() / 80) + 8 * static_cast<int>(uv.y() / 60));
      in_crowd += (uv.x() < 80 && uv.y() < 60) ? 1.0 / (kTrials * kFirst) : 0.0;
    }
    cells += static_cast<double>(met.size()) / kTrials;
  }
  // The crowd holds 90 % of the points on 1.6 % of the image. Drawn at random, 60 points would meet it 54
  // times and about 7 other cells of the 64.
  EXPECT_LT(in_crowd, 0.3);
  EXPECT_GT(cells, 30);
}

TEST(Quadtree, HasNoPreferenceAmongQuadrants) {
  // Plain breadth-first search always starts in the same quadrant (thesis 3.4.3).
  Quadtree tree(kWidth, kWidth, 400);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> side(0, 639);
  std::array<double, 4> share{};
  constexpr int kTrials = 200;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<Eigen::Vector2f> points;
    for (int i = 0; i < 400; ++i) points.emplace_back(side(random), side(random));
    const auto result = order(tree, points);
    for (std::size_t i = 0; i < 10; ++i) {
      const Eigen::Vector2f& uv = points[static_cast<std::size_t>(result[i])];
      share[(uv.x() >= 320 ? 1 : 0) + (uv.y() >= 320 ? 2 : 0)] += 1.0 / (10 * kTrials);
    }
  }
  for (const double s : share) EXPECT_NEAR(s, 0.25, 0.08);
}

TEST(Quadtree, RepeatsItselfAfterClear) {
  Quadtree tree(kWidth, kHeight, 1000);
  const auto points = crowded(2);
  EXPECT_EQ(order(tree, points), order(tree, points));
}

TEST(Quadtree, RefusesWhatDoesNotFit) {
  Quadtree tree(kWidth, kHeight, 2);
  EXPECT_FALSE(tree.insert({-1, 5}, 0));
  EXPECT_FALSE(tree.insert({5, 480}, 0));
  EXPECT_FALSE(tree.insert({std::numeric_limits<float>::quiet_NaN(), 5}, 0));
  EXPECT_TRUE(tree.insert({0, 0}, 0));
  EXPECT_TRUE(tree.insert({639.9F, 479.9F}, 1));
  EXPECT_FALSE(tree.insert({5, 5}, 2));  // full
}

}  // namespace
}  // namespace twofold
