#include "engine/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <thread>

namespace twofold {
namespace {

TEST(SpscRing, FullRingLeavesTheValueWithTheCaller) {
  SpscRing<std::unique_ptr<int>> ring(2);
  EXPECT_TRUE(ring.try_push(std::make_unique<int>(1)));
  EXPECT_TRUE(ring.try_push(std::make_unique<int>(2)));
  auto third = std::make_unique<int>(3);
  EXPECT_FALSE(ring.try_push(std::move(third)));
  ASSERT_NE(third, nullptr);
  EXPECT_EQ(*third, 3);

  std::unique_ptr<int> out;
  ASSERT_TRUE(ring.try_pop(out));
  EXPECT_EQ(*out, 1);
  EXPECT_TRUE(ring.try_push(std::move(third)));
  EXPECT_EQ(third, nullptr);
}

TEST(SpscRing, EmptyRingLeavesTheTargetAlone) {
  SpscRing<int> ring(4);
  int out = 7;
  EXPECT_FALSE(ring.has_value());
  EXPECT_FALSE(ring.try_pop(out));
  EXPECT_EQ(out, 7);
}

TEST(SpscRing, KeepsOrderAndSizeOverManyTurns) {
  SpscRing<int> ring(8);
  int next_in = 0;
  int next_out = 0;
  for (int turn = 0; turn < 1000; ++turn) {
    for (int k = 0; k < 1 + turn % 8 && ring.size_approx() < ring.capacity(); ++k) {
      int value = next_in;
      ASSERT_TRUE(ring.try_push(std::move(value)));
      ++next_in;
    }
    for (int k = 0; k < 1 + turn % 5; ++k) {
      int value = -1;
      const int* const front = ring.peek();
      const int seen = front == nullptr ? -1 : *front;
      ASSERT_EQ(front != nullptr, ring.has_value());
      if (!ring.try_pop(value)) break;
      ASSERT_EQ(value, seen);
      ASSERT_EQ(value, next_out++);
    }
    ASSERT_EQ(ring.size_approx(), static_cast<std::size_t>(next_in - next_out));
  }
}

TEST(SpscRing, DestroysWhatWasLeftInside) {
  auto counted = std::make_shared<int>(0);
  {
    SpscRing<std::shared_ptr<int>> ring(4);
    ASSERT_TRUE(ring.try_push(std::shared_ptr<int>(counted)));
    ASSERT_TRUE(ring.try_push(std::shared_ptr<int>(counted)));
    std::shared_ptr<int> out;
    ASSERT_TRUE(ring.try_pop(out));
    out.reset();
    EXPECT_EQ(counted.use_count(), 2);  // a popped slot owns nothing
  }
  EXPECT_EQ(counted.use_count(), 1);
}

TEST(SpscRingDeathTest, RefusesACapacityThatIsNoPowerOfTwo) {
  EXPECT_DEATH(SpscRing<int>(6), "power of two");
  EXPECT_DEATH(SpscRing<int>(0), "power of two");
}

// A message of several words: a torn or early read shows as words that disagree. Every message is counted.
struct Wide {
  std::array<std::uint64_t, 8> words{};
};

TEST(SpscRingStress, EveryMessageArrivesOnceAndWhole) {
  for (const std::size_t capacity : {1u, 2u, 64u}) {
    // A small ring changes threads with every message, and on a loaded machine that costs a turn of the
    // scheduler.
    const std::uint64_t messages = capacity < 64 ? 20'000 : 400'000;
    SpscRing<Wide> ring(capacity);
    std::uint64_t refused = 0;
    std::jthread producer([&] {
      for (std::uint64_t i = 0; i < messages;) {
        Wide message;
        message.words.fill(i);
        if (ring.try_push(std::move(message))) {
          ++i;
        } else {
          ++refused;
          std::this_thread::yield();
        }
      }
    });
    Wide message;
    for (std::uint64_t i = 0; i < messages;) {
      if (!ring.try_pop(message)) {
        std::this_thread::yield();
        continue;
      }
      for (const std::uint64_t word : message.words) ASSERT_EQ(word, i) << "capacity " << capacity;
      ++i;
    }
    producer.join();
    EXPECT_FALSE(ring.try_pop(message));
    EXPECT_EQ(ring.size_approx(), 0u);
  }
}

}  // namespace
}  // namespace twofold
