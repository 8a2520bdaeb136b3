#include "engine/load_ladder.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace twofold {
namespace {

constexpr std::int64_t kPeriod = 33'000'000;
constexpr auto kTop = LadderRung::kEverything;
constexpr auto kBottom = LadderRung::kDropFrames;

std::int64_t latency(double periods) {
  return static_cast<std::int64_t>(periods * kPeriod);
}

TEST(LoadLadder, GoesDownARungForEachLateFrameInTheStatedOrder) {
  LoadLadder ladder({});
  std::vector<LadderRung> rungs{ladder.rung()};
  for (int i = 0; i < 6; ++i) {
    ladder.tracked(latency(1.1), kPeriod);
    rungs.push_back(ladder.rung());
  }
  EXPECT_EQ(rungs, (std::vector<LadderRung>{kTop, LadderRung::kFewerPoints, LadderRung::kCoarseAlignment,
                                            LadderRung::kFewerIterations, kBottom, kBottom, kBottom}));
}

TEST(LoadLadder, ComesBackARungAtATimeAndOnlyAfterPatience) {
  const LadderOptions options{.patience = 10};
  LoadLadder ladder(options);
  for (int i = 0; i < 4; ++i) ladder.tracked(latency(2), kPeriod);
  for (int rung = static_cast<int>(kBottom); rung > 0; --rung) {
    for (int i = 0; i < options.patience; ++i) {
      EXPECT_EQ(static_cast<int>(ladder.rung()), rung);
      ladder.tracked(latency(0.3), kPeriod);
    }
    EXPECT_EQ(static_cast<int>(ladder.rung()), rung - 1);
  }
  for (int i = 0; i < 50; ++i) ladder.tracked(latency(0.3), kPeriod);
  EXPECT_EQ(ladder.rung(), kTop);
}

TEST(LoadLadder, StaysBetweenEarlyAndLate) {
  LoadLadder ladder({});
  ladder.tracked(latency(1.5), kPeriod);
  for (int i = 0; i < 500; ++i) {
    // One frame that is neither early nor late begins the count anew.
    ladder.tracked(latency(i % 29 == 0 ? 0.8 : 0.3), kPeriod);
    EXPECT_EQ(ladder.rung(), LadderRung::kFewerPoints) << i;
  }
}

TEST(LoadLadder, DropsOnTheLastRungOrBeyondTheBoundAndOnlyIfThePolicyAllows) {
  LoadLadder ladder({.drop_after = 1.5});
  const Arrival overtaken{0, latency(1.2), kPeriod, true};
  const Arrival beyond{0, latency(1.6), kPeriod, true};
  Arrival queued = beyond;
  queued.overtaken = false;
  EXPECT_FALSE(ladder.must_drop(overtaken));
  EXPECT_TRUE(ladder.must_drop(beyond));
  EXPECT_FALSE(ladder.must_drop(queued));
  for (int i = 0; i < 4; ++i) ladder.dropped();
  EXPECT_EQ(ladder.rung(), kBottom);
  EXPECT_TRUE(ladder.must_drop(overtaken));
  EXPECT_FALSE(ladder.must_drop(queued));
}

TEST(LoadLadder, WithoutAPaceNothingIsLate) {
  LoadLadder ladder({});
  for (int i = 0; i < 10; ++i) ladder.tracked(latency(100), 0);
  EXPECT_EQ(ladder.rung(), kTop);
}

TEST(LadderOptions, NameWhatIsWrong) {
  EXPECT_EQ(LadderOptions{}.invalid_reason(), "");
  EXPECT_NE(LadderOptions{.early = 2}.invalid_reason().find("early"), std::string::npos);
  EXPECT_NE(LadderOptions{.patience = 0}.invalid_reason().find("patience"), std::string::npos);
  EXPECT_NE(LadderOptions{.drop_after = 0.5}.invalid_reason().find("drop_after"), std::string::npos);
}

TEST(TrackEffort, EachRungLeavesOutMore) {
  const TrackerOptions options;
  TrackEffort before = effort_on(kTop, options);
  EXPECT_EQ(before.wanted_matches, options.wanted_matches);
  EXPECT_EQ(before.motion_iterations, options.motion.max_iterations);
  for (int r = 1; r < kLadderRungs; ++r) {
    const TrackEffort now = effort_on(static_cast<LadderRung>(r), options);
    EXPECT_LE(now.max_searches, before.max_searches);
    EXPECT_GE(now.finest_alignment_level, before.finest_alignment_level);
    EXPECT_LE(now.motion_iterations, before.motion_iterations);
    EXPECT_GE(now.wanted_matches, options.min_inliers);
    const bool less = now.max_searches < before.max_searches ||
                      now.finest_alignment_level > before.finest_alignment_level ||
                      now.motion_iterations < before.motion_iterations;
    EXPECT_EQ(less, r < static_cast<int>(kBottom));  // the last rung leaves out frames
    before = now;
  }
}

}  // namespace
}  // namespace twofold
