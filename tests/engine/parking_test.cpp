#include "engine/parking.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>

#include "engine/spsc_ring.hpp"

namespace twofold {
namespace {

using namespace std::chrono_literals;

TEST(Parking, DoesNotSleepWhenReady) {
  Parking parking;
  EXPECT_TRUE(parking.wait({}, [] { return true; }));
}

TEST(Parking, AWakeEndsTheSleepLongBeforeItsDeadline) {
  Parking parking;
  std::atomic<bool> value{false};
  std::atomic<int> looks{0};
  const auto begin = std::chrono::steady_clock::now();
  std::jthread sleeper([&] {
    const auto ready = [&] {
      ++looks;
      return value.load();
    };
    EXPECT_TRUE(parking.wait_until({}, begin + 60s, ready));
  });
  while (looks < 2) std::this_thread::yield();  // before and after its announcement: now it goes to sleep
  std::this_thread::sleep_for(5ms);
  value = true;
  parking.wake();
  sleeper.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
}

TEST(Parking, EndsAtTheDeadlineAndNotBefore) {
  Parking parking;
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(parking.wait_until({}, begin + 20ms, [] { return false; }));
  EXPECT_GE(std::chrono::steady_clock::now() - begin, 20ms);
  EXPECT_FALSE(parking.wait_until({}, begin, [] { return false; }));  // past already
}

TEST(Parking, AStopRequestEndsTheSleep) {
  Parking parking;
  std::jthread sleeper(
      [&](const std::stop_token& stop) { EXPECT_FALSE(parking.wait(stop, [] { return false; })); });
  std::this_thread::sleep_for(5ms);
  sleeper.request_stop();
  sleeper.join();
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_FALSE(parking.wait(stopped.get_token(), [] { return false; }));
}

// Two producers, a ring each, one consumer that sleeps whenever both are empty. A lost wake-up hangs (and the
// test times out); every message is counted.
TEST(ParkingStress, NoWakeUpIsLost) {
  constexpr std::uint64_t kMessages = 30'000;
  Parking parking;
  std::array<SpscRing<std::uint64_t>, 2> rings{SpscRing<std::uint64_t>(4), SpscRing<std::uint64_t>(4)};
  const auto produce = [&](std::size_t me) {
    for (std::uint64_t i = 0; i < kMessages;) {
      std::uint64_t value = i;
      if (rings[me].try_push(std::move(value))) {
        parking.wake();
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  };
  std::jthread first(produce, 0);
  std::jthread second(produce, 1);
  std::array<std::uint64_t, 2> received{};
  while (received[0] + received[1] < 2 * kMessages) {
    ASSERT_TRUE(parking.wait({}, [&] { return rings[0].has_value() || rings[1].has_value(); }));
    for (std::size_t i = 0; i < 2; ++i) {
      std::uint64_t value = 0;
      while (rings[i].try_pop(value)) ASSERT_EQ(value, received[i]++);
    }
  }
  EXPECT_EQ(received[0], kMessages);
  EXPECT_EQ(received[1], kMessages);
}

}  // namespace
}  // namespace twofold
