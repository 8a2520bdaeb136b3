#include "slam/latest_value.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <thread>
#include <vector>

namespace twofold {
namespace {

/// Large enough to be torn.
struct Block {
  std::array<std::uint64_t, 64> words{};
};

Block block_of(std::uint64_t number) {
  Block block;
  block.words.fill(number);
  return block;
}

bool is_whole(const Block& block) {
  for (const std::uint64_t word : block.words) {
    if (word != block.words.front()) return false;
  }
  return true;
}

TEST(LatestValue, HoldsNothingBeforeTheFirstValueAndThenTheNewest) {
  LatestValue<int> latest;
  EXPECT_EQ(latest.get(), std::nullopt);
  for (int i = 0; i < 100; ++i) {
    EXPECT_TRUE(latest.put(i));
    EXPECT_EQ(latest.get(), i);
    EXPECT_EQ(latest.get(), i);
  }
}

TEST(LatestValue, ReadersNeverSeeTornOrOlderValues) {
  constexpr std::uint64_t kValues = 100'000;
  LatestValue<Block> latest;
  std::atomic<int> torn{0}, older{0};
  std::vector<std::thread> readers;
  for (int r = 0; r < 3; ++r) {
    readers.emplace_back([&] {
      std::uint64_t last = 0;
      while (last < kValues) {
        const auto block = latest.get();
        if (!block) continue;
        torn += !is_whole(*block);
        older += block->words.front() < last;
        last = block->words.front();
      }
    });
  }
  std::uint64_t gave_up = 0;
  for (std::uint64_t v = 1; v < kValues; ++v) gave_up += !latest.put(block_of(v));
  while (!latest.put(block_of(kValues))) std::this_thread::yield();
  for (std::thread& reader : readers) reader.join();
  EXPECT_EQ(torn, 0);
  EXPECT_EQ(older, 0);
  EXPECT_EQ(gave_up, 0U) << "three readers cannot occupy seven slots";
}

}  // namespace
}  // namespace twofold
