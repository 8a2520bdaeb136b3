#include "base/median.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace twofold {
namespace {

TEST(Median, IsTheMiddleOneOfAnOddNumber) {
  std::vector<double> values{9, -2, 4, 100, 3};
  EXPECT_EQ(median(std::span(values)), 4);
}

TEST(Median, IsTheUpperOfTheTwoMiddleOnesOfAnEvenNumber) {
  std::vector<float> values{8, 1, 3, 2};
  EXPECT_EQ(median(std::span(values)), 3);
}

TEST(Median, IsZeroOfNone) {
  EXPECT_EQ(median(std::span<double>()), 0);
}

TEST(Quantile, IsOneOfTheValues) {
  std::vector<double> values{5, 1, 4, 2, 3, 6};
  EXPECT_EQ(quantile(values, 0, QuantileRank::kLower), 1);
  EXPECT_EQ(quantile(values, 1, QuantileRank::kLower), 6);
  EXPECT_EQ(quantile(values, 0.5, QuantileRank::kLower), 3);  // between 3 and 4
  EXPECT_EQ(quantile(values, 0.5, QuantileRank::kNearest), 4);
  EXPECT_EQ(quantile(values, 0.25, QuantileRank::kLower), 2);  // a quarter of the way from 2 to 3
  EXPECT_EQ(quantile(values, 0.25, QuantileRank::kNearest), 2);
  EXPECT_EQ(quantile(std::span<double>(), 0.5, QuantileRank::kNearest), 0);
}

}  // namespace
}  // namespace twofold
