#include "slam/hand_over_slot.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <thread>

namespace twofold {
namespace {

std::atomic<int> g_live{0};  // parcels

/// Large enough to be seen in part.
class Parcel {
 public:
  explicit Parcel(std::uint64_t number) {
    words_.fill(number);
    ++g_live;
  }
  ~Parcel() { --g_live; }
  Parcel(const Parcel&) = delete;
  Parcel& operator=(const Parcel&) = delete;

  [[nodiscard]] std::uint64_t number() const { return words_.front(); }
  [[nodiscard]] bool complete() const {
    for (const std::uint64_t word : words_) {
      if (word != number()) return false;
    }
    return true;
  }

 private:
  std::array<std::uint64_t, 64> words_{};
};

TEST(HandOverSlot, GivesTheNewestAwayOnce) {
  HandOverSlot<Parcel> slot;
  EXPECT_EQ(slot.take(), nullptr);
  slot.put(std::make_unique<Parcel>(1));
  slot.put(std::make_unique<Parcel>(2));
  EXPECT_EQ(g_live, 1) << "1 was never seen";
  const auto taken = slot.take();
  ASSERT_NE(taken, nullptr);
  EXPECT_EQ(taken->number(), 2U);
  EXPECT_EQ(slot.take(), nullptr);
  slot.put(std::make_unique<Parcel>(3));
  EXPECT_EQ(g_live, 2) << "what was taken is the taker's";
}

TEST(HandOverSlot, DestroysWhatNobodyTook) {
  {
    HandOverSlot<Parcel> slot;
    slot.put(std::make_unique<Parcel>(1));
    EXPECT_EQ(g_live, 1);
  }
  EXPECT_EQ(g_live, 0);
}

TEST(HandOverSlotStress, WhatIsTakenIsCompleteAndNewer) {
  constexpr std::uint64_t kParcels = 100'000;
  HandOverSlot<Parcel> slot;
  int broken = 0;
  std::thread taker([&] {
    for (std::uint64_t last = 0; last < kParcels;) {
      const auto parcel = slot.take();
      if (!parcel) {
        std::this_thread::yield();
        continue;
      }
      broken += parcel->number() <= last || !parcel->complete();
      last = parcel->number();
    }
  });
  for (std::uint64_t n = 1; n <= kParcels; ++n) {
    slot.put(std::make_unique<Parcel>(n));
    if (n % 64 == 0) std::this_thread::yield();
  }
  taker.join();
  EXPECT_EQ(broken, 0);
  EXPECT_EQ(g_live, 0);
}

}  // namespace
}  // namespace twofold
