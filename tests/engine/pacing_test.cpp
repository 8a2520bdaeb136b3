#include "engine/pacing.hpp"

#include <gtest/gtest.h>

#include <cmath>

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

TEST(Pacer, FollowsRecordedStampsAtTheAskedSpeed) {
  for (const double speed : {1.0, 2.0}) {
    FakeClock clock;
    const std::int64_t start = clock.now;
    Pacer pacer({speed, LatePolicy::kQueue}, &clock);
    for (const std::int64_t t : {0, 33, 66, 200}) {  // a gap in the recording is waited for
      const Arrival arrival = pacer.wait_for(1'000'000 * kMs + t * kMs, std::nullopt, {});
      EXPECT_EQ(arrival.scheduled_ns - start, std::llround(static_cast<double>(t * kMs) / speed));
      EXPECT_EQ(clock.now, arrival.scheduled_ns);
      EXPECT_EQ(arrival.late_ns, 0);
      EXPECT_FALSE(arrival.overtaken);
    }
  }
}

TEST(Pacer, OneSlowFrameShowsInAllItDelays) {
  FakeClock clock;
  Pacer pacer({1.0, LatePolicy::kQueue}, &clock);
  std::vector<std::int64_t> late_ms;
  for (int i = 0; i < 6; ++i) {
    late_ms.push_back(pacer.wait_for(i * 10 * kMs, (i + 1) * 10 * kMs, {}).late_ns / kMs);
    clock.now += (i == 1 ? 35 : 4) * kMs;  // work on the frame
  }
  EXPECT_EQ(late_ms, (std::vector<std::int64_t>{0, 0, 25, 19, 13, 7}));
}

TEST(Pacer, SaysWhichFramesTheirSuccessorsOvertook) {
  FakeClock clock;
  Pacer pacer({1.0, LatePolicy::kDrop}, &clock);
  std::vector<bool> overtaken;
  for (int i = 0; i < 6; ++i) {
    const auto next = i == 5 ? std::nullopt : std::optional<std::int64_t>((i + 1) * 10 * kMs);
    const Arrival arrival = pacer.wait_for(i * 10 * kMs, next, {});
    overtaken.push_back(arrival.overtaken);
    EXPECT_EQ(arrival.period_ns, 10 * kMs);
    if (!arrival.overtaken) clock.now += (i == 1 ? 35 : 4) * kMs;
  }
  // Frame 1 ends at 45 ms: 2 (20..30) and 3 (30..40) are past, 4 is the newest.
  EXPECT_EQ(overtaken, (std::vector<bool>{false, false, true, true, false, false}));
}

TEST(Pacer, TheLastFrameIsNeverOvertaken) {
  FakeClock clock;
  Pacer pacer({1.0, LatePolicy::kDrop}, &clock);
  (void)pacer.wait_for(0, 10 * kMs, {});
  clock.now += 1000 * kMs;
  const Arrival last = pacer.wait_for(10 * kMs, std::nullopt, {});
  EXPECT_FALSE(last.overtaken);
  EXPECT_EQ(last.late_ns, 990 * kMs);
}

TEST(Pacer, FullSpeedHasNoPace) {
  FakeClock clock;
  const std::int64_t start = clock.now;
  Pacer pacer({0.0, LatePolicy::kDrop}, &clock);
  for (int i = 0; i < 5; ++i) {
    const Arrival arrival = pacer.wait_for(i * 1000 * kMs, (i + 1) * 1000 * kMs, {});
    EXPECT_EQ(arrival.late_ns, 0);
    EXPECT_EQ(arrival.period_ns, 0);
    EXPECT_FALSE(arrival.overtaken);
  }
  EXPECT_EQ(clock.now, start);
}

TEST(Pacer, SteadyClockWaitsAndAStopEndsIt) {
  Pacer pacer({1.0, LatePolicy::kQueue});
  std::stop_source stop;
  const Arrival first = pacer.wait_for(0, std::nullopt, stop.get_token());
  const Arrival second = pacer.wait_for(15 * kMs, std::nullopt, stop.get_token());
  EXPECT_EQ(second.scheduled_ns - first.scheduled_ns, 15 * kMs);
  EXPECT_GE(steady_now_ns() - first.scheduled_ns, 15 * kMs);
  stop.request_stop();
  (void)pacer.wait_for(3'600'000 * kMs, std::nullopt, stop.get_token());  // an hour
  EXPECT_LT(steady_now_ns() - first.scheduled_ns, 60'000 * kMs);
}

TEST(PacingOptions, NamesWhatIsWrong) {
  EXPECT_EQ(PacingOptions{}.invalid_reason(), "");
  EXPECT_NE((PacingOptions{-1.0}).invalid_reason().find("speed"), std::string::npos);
  EXPECT_NE((PacingOptions{std::nan("")}).invalid_reason().find("speed"), std::string::npos);
}

}  // namespace
}  // namespace twofold
