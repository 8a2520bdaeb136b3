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

}  // namespace
}  // namespace twofold
