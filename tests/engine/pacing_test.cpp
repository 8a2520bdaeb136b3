#include "engine/pacing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace twofold {
namespace {

constexpr std::int64_t kMs = 1'000'000;

class FakeClock : public PacingClock {
 public:
  std::int64_t now_ns() override { return now; }
  void sleep_until(std::int64_t t_ns, const std::stop_token& stop) override {
    if (!stop.stop_requested() && t_ns > now) now = t_ns;
  }
  std::int64_t now = 5'000 * kMs;
};

/// The turn of a frame, none, or one with time stamp `next_t_ns`, being there behind it.
Arrival turn(Pacer& pacer, std::int64_t t_ns, std::optional<std::int64_t> next_t_ns = std::nullopt) {
  return pacer.wait_for(t_ns, [&] { return next_t_ns; });
}

TEST(Pacer, FollowsRecordedStampsAtTheAskedSpeed) {
  for (const double speed : {1.0, 2.0}) {
    FakeClock clock;
    const std::int64_t start = clock.now;
    Pacer pacer({.speed = speed}, &clock);
    for (const std::int64_t t : {0, 33, 66, 200}) {  // a gap in the recording is waited for
      const Arrival arrival = turn(pacer, 1'000'000 * kMs + t * kMs);
      EXPECT_EQ(arrival.exposed_ns - start, std::llround(static_cast<double>(t * kMs) / speed));
      EXPECT_EQ(clock.now, arrival.exposed_ns);
      EXPECT_EQ(arrival.late_ns, 0);
      EXPECT_EQ(arrival.period_ns, std::llround(t == 0 ? 0 : static_cast<double>(33 * kMs) / speed));
      EXPECT_FALSE(arrival.overtaken);
    }
  }
}

TEST(Pacer, WhenWaitsHaveEndedAFrameIsExposedWhenItIsAskedFor) {
  FakeClock clock;
  Pacer pacer({.speed = 1}, &clock);
  (void)turn(pacer, 0);
  pacer.end_waits();
  const std::int64_t now = clock.now;
  const Arrival arrival = turn(pacer, 3'600'000 * kMs);
  EXPECT_EQ(clock.now, now);
  EXPECT_EQ(arrival.exposed_ns, now);
  EXPECT_EQ(arrival.late_ns, 0);
}

TEST(Pacer, OneSlowFrameShowsInAllItDelays) {
  FakeClock clock;
  Pacer pacer({.speed = 1}, &clock);
  std::vector<std::int64_t> late_ms;
  for (int i = 0; i < 6; ++i) {
    late_ms.push_back(turn(pacer, i * 10 * kMs, (i + 1) * 10 * kMs).late_ns / kMs);
    clock.now += (i == 1 ? 35 : 4) * kMs;  // work on the frame
  }
  EXPECT_EQ(late_ms, (std::vector<std::int64_t>{0, 0, 25, 19, 13, 7}));
}

TEST(Pacer, SaysWhichFramesTheirSuccessorsOvertook) {
  FakeClock clock;
  Pacer pacer({.speed = 1}, &clock);
  std::vector<bool> overtaken;
  for (int i = 0; i < 6; ++i) {
    const auto next = i == 5 ? std::nullopt : std::optional<std::int64_t>((i + 1) * 10 * kMs);
    const Arrival arrival = turn(pacer, i * 10 * kMs, next);
    overtaken.push_back(arrival.overtaken);
    if (!arrival.overtaken) clock.now += (i == 1 ? 35 : 4) * kMs;
  }
  // Frame 1 ends at 45 ms: 2 (20..30) and 3 (30..40) are past, 4 is the newest.
  EXPECT_EQ(overtaken, (std::vector<bool>{false, false, true, true, false, false}));
}

TEST(Pacer, AFrameWithoutASuccessorIsNeverOvertaken) {
  FakeClock clock;
  Pacer pacer({.speed = 1}, &clock);
  (void)turn(pacer, 0, 10 * kMs);
  clock.now += 1000 * kMs;
  const Arrival last = turn(pacer, 10 * kMs);
  EXPECT_FALSE(last.overtaken);
  EXPECT_EQ(last.late_ns, 990 * kMs);
}

TEST(Pacer, ACamerasFramesAreExposedAtTheirStampsAndNeverWaitedFor) {
  FakeClock clock;
  Pacer pacer({.late = LatePolicy::kNewest, .live = true}, &clock);
  const std::int64_t t0 = clock.now;
  std::vector<std::int64_t> late_ms;
  // The first frame is looked at late, a pause follows, then one is stamped ahead of its exposure.
  for (const auto& [t, looked_at] :
       {std::pair{0, 300}, {600, 604}, {633, 637}, {667, 671}, {700, 712}, {733, 730}}) {
    clock.now = t0 + looked_at * kMs;
    const Arrival arrival = turn(pacer, t0 + t * kMs);
    EXPECT_EQ(arrival.exposed_ns, t0 + t * kMs);
    EXPECT_EQ(clock.now, t0 + looked_at * kMs) << "waited with the frame in hand";
    EXPECT_FALSE(arrival.overtaken);
    late_ms.push_back(arrival.late_ns / kMs);
    if (t >= 667) {
      EXPECT_NEAR(static_cast<double>(arrival.period_ns), 33.5 * kMs, kMs);
    }
  }
  EXPECT_EQ(late_ms, (std::vector<std::int64_t>{300, 4, 4, 4, 12, 0}));
  EXPECT_TRUE(turn(pacer, t0 + 690 * kMs, t0 + 720 * kMs).overtaken);
}

TEST(Pacer, FullSpeedHasNoPace) {
  FakeClock clock;
  const std::int64_t start = clock.now;
  Pacer pacer({.speed = 0}, &clock);
  for (int i = 0; i < 5; ++i) {
    const Arrival arrival = turn(pacer, i * 1000 * kMs, (i + 1) * 1000 * kMs);
    EXPECT_EQ(arrival.late_ns, 0);
    EXPECT_EQ(arrival.period_ns, 0);
    EXPECT_FALSE(arrival.overtaken);
  }
  EXPECT_EQ(clock.now, start);
}

TEST(Pacer, SteadyClockWaitsUntilWaitsEnd) {
  Pacer pacer({.speed = 1});
  const Arrival first = turn(pacer, 0);
  const Arrival second = turn(pacer, 15 * kMs);
  EXPECT_EQ(second.exposed_ns - first.exposed_ns, 15 * kMs);
  EXPECT_GE(steady_now_ns() - first.exposed_ns, 15 * kMs);
  pacer.end_waits();
  (void)turn(pacer, 3'600'000 * kMs);  // an hour
  EXPECT_LT(steady_now_ns() - first.exposed_ns, 60'000 * kMs);
}

TEST(PacingOptions, NamesWhatIsWrong) {
  EXPECT_EQ(PacingOptions{}.invalid_reason(), "");
  EXPECT_NE((PacingOptions{-1.0}).invalid_reason().find("speed"), std::string::npos);
  EXPECT_NE((PacingOptions{std::nan("")}).invalid_reason().find("speed"), std::string::npos);
}

}  // namespace
}  // namespace twofold
