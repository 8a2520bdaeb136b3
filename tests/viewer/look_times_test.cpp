#include "viewer/look_times.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace twofold {
namespace {

constexpr std::int64_t kMs = 1'000'000;

/// A camera that brings a frame each `interval` from 0 on, which the tracker tells some milliseconds later.
struct Camera {
  std::int64_t interval_ns = 0;
  std::int64_t shortest_ns = 1 * kMs, longest_ns = 1 * kMs;  ///< that a frame takes
  int left_out = 0;                                          ///< frames of each seven, or so
};

/// Looks at what `camera` brings, until `end_ns`.
std::vector<std::int64_t> looks(const Camera& camera, std::int64_t period_ns, std::int64_t end_ns) {
  std::mt19937 random(3);
  std::uniform_int_distribution<std::int64_t> takes(camera.shortest_ns, camera.longest_ns);
  LookTimes times;
  std::vector<std::int64_t> found;
  std::int64_t frame = 0;
  std::int64_t told_ns = takes(random);
  for (std::int64_t now_ns = 5 * kMs; now_ns < end_ns; now_ns = times.next(now_ns, period_ns)) {
    found.push_back(now_ns);
    for (; told_ns <= now_ns; told_ns = frame * camera.interval_ns + takes(random)) {
      times.add_frame(frame, told_ns);
      frame += frame % 7 < camera.left_out ? 1 + camera.left_out : 1;
    }
  }
  return found;
}

/// How long after a frame came, at most of a second in.
std::vector<double> phases_ms(const std::vector<std::int64_t>& looks, std::int64_t interval_ns) {
  std::vector<double> phases;
  for (const std::int64_t look : looks)
    if (look > 1000 * kMs) phases.push_back(static_cast<double>(look % interval_ns) / kMs);
  return phases;
}

TEST(LookTimesTest, AreEvenWhileNoFrameComes) {
  const LookTimes times;
  EXPECT_EQ(times.next(70 * kMs, 10 * kMs), 80 * kMs);
}

TEST(LookTimesTest, NeverFallIntoAFrameThatIsTracked) {
  constexpr std::int64_t kInterval = 33'333'333;
  const Camera camera{.interval_ns = kInterval, .shortest_ns = kMs, .longest_ns = 3 * kMs};
  const auto found = looks(camera, 10 * kMs, 20'000 * kMs);
  EXPECT_NEAR(static_cast<double>(found.size()), 20'000 / 11.1, 30);
  for (const double phase : phases_ms(found, kInterval)) {
    EXPECT_GT(phase, 2.9);
    EXPECT_LT(phase, 33.3);
  }
}

TEST(LookTimesTest, KeepStepWhileNobodyLooks) {
  constexpr std::int64_t kInterval = 50 * kMs;
  for (const double phase : phases_ms(looks({.interval_ns = kInterval}, 100 * kMs, 10'000 * kMs), kInterval))
    EXPECT_NEAR(phase, 3, 0.1);
}

TEST(LookTimesTest, KeepStepWithACameraFasterThanTheyAre) {
  constexpr std::int64_t kInterval = 4 * kMs;
  const auto found = looks({.interval_ns = kInterval}, 10 * kMs, 10'000 * kMs);
  EXPECT_NEAR(static_cast<double>(found.size()), 10'000 / 12., 200) << "every second or third frame";
  for (const double phase : phases_ms(found, kInterval)) EXPECT_NEAR(phase, 3, 0.1);
}

TEST(LookTimesTest, KeepStepWithFramesOfWhichSomeAreLeftOut) {
  constexpr std::int64_t kInterval = 10 * kMs;
  for (const double phase :
       phases_ms(looks({.interval_ns = kInterval, .left_out = 3}, 10 * kMs, 10'000 * kMs), kInterval))
    EXPECT_NEAR(phase, 3, 0.1);
}

TEST(LookTimesTest, AreWithinAPeriodAndAHalfWhateverComes) {
  LookTimes times;
  std::mt19937 random(7);
  std::uniform_int_distribution<std::int64_t> gap(0, 60 * kMs), skip(-2, 20);
  std::int64_t now_ns = 0;
  std::int64_t frame = 0;
  for (int n = 0; n < 10'000; ++n) {
    frame += skip(random);
    now_ns += gap(random);
    times.add_frame(frame, now_ns - gap(random));
    const std::int64_t next_ns = times.next(now_ns, 10 * kMs);
    EXPECT_GE(next_ns, now_ns + 3 * kMs) << n;
    EXPECT_LE(next_ns, now_ns + 23 * kMs) << n;
  }
}

TEST(LookTimesTest, AreEvenAgainAfterTheCameraHasEnded) {
  LookTimes times;
  times.add_frame(0, 0);
  times.add_frame(1, 20 * kMs);
  EXPECT_EQ(times.next(21 * kMs, 10 * kMs), 32 * kMs) << "half of 20 ms, 2 ms after the frame";
  EXPECT_EQ(times.next(500 * kMs, 10 * kMs), 510 * kMs);
}

}  // namespace
}  // namespace twofold
