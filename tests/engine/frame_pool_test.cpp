#include "engine/frame_pool.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <thread>
#include <vector>

#include "engine/spsc_ring.hpp"

namespace twofold {
namespace {

TEST(FramePool, GivesOutEachObjectOnceAndAgainAfterItCameBack) {
  FramePool<std::vector<int>> pool(2, [](std::vector<int>& buffer) { buffer.reserve(100); });
  auto first = pool.try_acquire();
  auto second = pool.try_acquire();
  ASSERT_TRUE(first && second);
  EXPECT_NE(&*first, &*second);
  EXPECT_GE(first->capacity(), 100u);
  EXPECT_FALSE(pool.try_acquire());
  const auto* address = &*first;
  first.reset();
  EXPECT_FALSE(first);
  EXPECT_EQ(&*pool.try_acquire(), address);
}

TEST(FramePool, ComesBackFromWhereItsHandleWasMovedTo) {
  FramePool<int> pool(1);
  auto handle = pool.try_acquire();
  auto moved = std::move(handle);
  EXPECT_FALSE(handle);  // NOLINT(bugprone-use-after-move): moved-from handles are specified as empty
  handle.reset();
  EXPECT_FALSE(pool.try_acquire());
  moved = {};
  EXPECT_TRUE(pool.try_acquire());
}

// One filler, two users by turns; an object filled anew while in use shows as words that change or disagree.
TEST(FramePoolStress, NoObjectIsFilledWhileInUse) {
  constexpr std::uint64_t kFrames = 30'000;
  using Object = std::array<std::uint64_t, 8>;
  using Handle = PoolHandle<Object>;
  FramePool<Object> pool(5);
  std::array<SpscRing<Handle>, 2> rings{SpscRing<Handle>(4), SpscRing<Handle>(4)};
  std::array<std::uint64_t, 2> received{};
  std::array<std::uint64_t, 2> broken{};
  const auto use = [&](std::size_t me) {
    while (received[me] < kFrames) {
      Handle handle;
      if (!rings[me].try_pop(handle)) {
        std::this_thread::yield();
        continue;
      }
      for (const std::uint64_t word : *handle) broken[me] += word != 2 * received[me] + me;
      ++received[me];
    }
  };
  {
    std::jthread first(use, 0);
    std::jthread second(use, 1);
    for (std::uint64_t i = 0; i < 2 * kFrames; ++i) {
      Handle handle;
      while (!(handle = pool.try_acquire())) std::this_thread::yield();
      handle->fill(i);
      while (!rings[i % 2].try_push(std::move(handle))) std::this_thread::yield();
    }
  }
  EXPECT_EQ(received[0], kFrames);
  EXPECT_EQ(received[1], kFrames);
  EXPECT_EQ(broken[0] + broken[1], 0u);
  std::vector<Handle> all;
  while (Handle handle = pool.try_acquire()) all.push_back(std::move(handle));
  EXPECT_EQ(all.size(), pool.capacity());  // every object came back
}

}  // namespace
}  // namespace twofold
