#include "imaging/pixel_row.hpp"

#include <gtest/gtest.h>

#include <array>

namespace twofold {
namespace {

TEST(PixelRow, BytesAreNumbersFrom0To255) {
  const std::array<std::uint8_t, 8> pixels{0, 1, 127, 128, 129, 200, 254, 255};
  const Floats8 numbers = load_floats(pixels.data());
  for (std::size_t i = 0; i < pixels.size(); ++i) EXPECT_EQ(numbers[i], static_cast<float>(pixels[i]));
}

TEST(PixelRow, WhatFollowsThePointIsDropped) {
  const Floats8 numbers{0.99F, 1.5F, -0.99F, -1.5F, 255.5F, -300.75F, 32767.0F, -32768.0F};
  const std::array<std::int16_t, 8> expected{0, 1, 0, -1, 255, -300, 32767, -32768};
  const Shorts8 whole = truncate(numbers);
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_EQ(whole[i], expected[i]);
}

TEST(PixelRow, SumsStandInTheOrderOfTheirRows) {
  Floats8 rows[8];
  std::array<float, 8> expected{};
  for (std::size_t r = 0; r < 8; ++r) {
    for (std::size_t c = 0; c < 8; ++c) {
      rows[r][c] = static_cast<float>((r + 1) * (1U << c));  // no two rows or columns alike; whole, so exact
      expected[r] += rows[r][c];
    }
  }
  const Floats8 sums = sums_of_rows(rows);
  for (std::size_t r = 0; r < 8; ++r) EXPECT_EQ(sums[r], expected[r]);
}

}  // namespace
}  // namespace twofold
