#include "engine/logs/chunked_vector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace twofold {
namespace {

TEST(ChunkedVector, KeepsEveryValueWhereItWasPut) {
  ChunkedVector<int, 8> numbers;
  EXPECT_TRUE(numbers.empty());
  std::vector<const int*> places;
  for (int i = 0; i < 1000; ++i) {
    numbers.push_back(i);
    places.push_back(&numbers.back());
    EXPECT_EQ(numbers.size(), static_cast<std::size_t>(i + 1));
  }
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    EXPECT_EQ(&numbers[i], places[i]) << "value " << i << " was copied";
    EXPECT_EQ(numbers[i], static_cast<int>(i));
  }
  EXPECT_EQ(numbers.front(), 0);
  EXPECT_EQ(std::accumulate(numbers.begin(), numbers.end(), 0), 999 * 500);
  EXPECT_EQ(*std::find(numbers.begin(), numbers.end(), 77), 77);
  std::size_t in_chunks = 0;
  for (const std::vector<int>& chunk : numbers.chunks()) in_chunks += chunk.size();
  EXPECT_EQ(in_chunks, numbers.size());
}

TEST(ChunkedVector, ACopyIsItsOwn) {
  ChunkedVector<int, 4> numbers;
  for (int i = 0; i < 6; ++i) numbers.push_back(i);
  ChunkedVector<int, 4> copy = numbers;
  copy[5] = 50;
  copy.push_back(60);
  EXPECT_EQ(numbers[5], 5);
  EXPECT_EQ(numbers.size(), 6U);
  EXPECT_EQ(copy.back(), 60);
}

}  // namespace
}  // namespace twofold
