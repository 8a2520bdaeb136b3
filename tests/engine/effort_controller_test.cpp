#include "engine/effort_controller.hpp"

#include "tracking/effort_bounds.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace twofold {
namespace {

constexpr std::int64_t kPeriod = 33'000'000;
constexpr auto kTop = EffortLevel::kEverything;
constexpr auto kBottom = EffortLevel::kDropFrames;

std::int64_t latency(double periods) {
  return static_cast<std::int64_t>(periods * kPeriod);
}

TEST(EffortController, GoesDownALevelForEachLateFrameInTheStatedOrder) {
  EffortController controller({}, LatePolicy::kDrop);
  std::vector<EffortLevel> levels{controller.effort()};
  for (int i = 0; i < 6; ++i) {
    controller.tracked(latency(1.1), kPeriod);
    levels.push_back(controller.effort());
  }
  EXPECT_EQ(levels, (std::vector<EffortLevel>{kTop, EffortLevel::kFewerPoints, EffortLevel::kCoarseAlignment,
                                              EffortLevel::kFewerIterations, kBottom, kBottom, kBottom}));
}

TEST(EffortController, ComesBackALevelAtATimeAndOnlyAfterPatience) {
  const EffortOptions options{.patience = 10};
  EffortController controller(options, LatePolicy::kDrop);
  for (int i = 0; i < 4; ++i) controller.tracked(latency(2), kPeriod);
  for (int effort = static_cast<int>(kBottom); effort > 0; --effort) {
    for (int i = 0; i < options.patience; ++i) {
      EXPECT_EQ(static_cast<int>(controller.effort()), effort);
      controller.tracked(latency(0.3), kPeriod);
    }
    EXPECT_EQ(static_cast<int>(controller.effort()), effort - 1);
  }
  for (int i = 0; i < 50; ++i) controller.tracked(latency(0.3), kPeriod);
  EXPECT_EQ(controller.effort(), kTop);
}

TEST(EffortController, StaysBetweenEarlyAndLate) {
  EffortController controller({}, LatePolicy::kDrop);
  controller.tracked(latency(1.5), kPeriod);
  for (int i = 0; i < 500; ++i) {
    // One frame that is neither early nor late begins the count anew.
    controller.tracked(latency(i % 29 == 0 ? 0.8 : 0.3), kPeriod);
    EXPECT_EQ(controller.effort(), EffortLevel::kFewerPoints) << i;
  }
}

TEST(EffortController, DropsOnTheLastLevelOrBeyondTheBoundAndOnlyIfThePolicyAllows) {
  EffortController controller({.drop_after = 1.5}, LatePolicy::kDrop);
  const Arrival overtaken{0, latency(1.2), kPeriod, true};
  const Arrival beyond{0, latency(1.6), kPeriod, true};
  Arrival queued = beyond;
  queued.overtaken = false;
  EXPECT_FALSE(controller.must_drop(overtaken));
  EXPECT_TRUE(controller.must_drop(beyond));
  EXPECT_FALSE(controller.must_drop(queued));
  for (int i = 0; i < 4; ++i) controller.dropped();
  EXPECT_EQ(controller.effort(), kBottom);
  EXPECT_TRUE(controller.must_drop(overtaken));
  EXPECT_FALSE(controller.must_drop(queued));
}

TEST(EffortController, TheNewestFrameWinsAtOnceAndAQueueLosesNone) {
  const Arrival waited{0, latency(3), kPeriod, false};
  const Arrival overtaken{0, latency(0.1), kPeriod, true};
  const EffortController newest({}, LatePolicy::kNewest);
  EXPECT_TRUE(newest.must_drop(overtaken));
  EXPECT_FALSE(newest.must_drop(waited));
  EXPECT_FALSE(EffortController({}, LatePolicy::kQueue).must_drop({0, latency(9), kPeriod, true}));
}

TEST(EffortController, WithoutAPaceNothingIsLate) {
  EffortController controller({}, LatePolicy::kDrop);
  for (int i = 0; i < 10; ++i) controller.tracked(latency(100), 0);
  EXPECT_EQ(controller.effort(), kTop);
}

TEST(EffortOptions, NameWhatIsWrong) {
  EXPECT_EQ(EffortOptions{}.invalid_reason(), "");
  EXPECT_NE(EffortOptions{.early = 2}.invalid_reason().find("early"), std::string::npos);
  EXPECT_NE(EffortOptions{.patience = 0}.invalid_reason().find("patience"), std::string::npos);
  EXPECT_NE(EffortOptions{.drop_after = 0.5}.invalid_reason().find("drop_after"), std::string::npos);
}

TEST(EffortBounds, ByHowMuchIsAnOption) {
  TrackerOptions options;
  options.effort = {
      .points_share = 0.75, .coarse_levels = 1, .iterations_share = 0.2, .min_motion_iterations = 4};
  const EffortBounds bounds = bounds_of(EffortLevel::kFewerIterations, options);
  EXPECT_EQ(bounds.wanted_matches, 135);  // of 180
  EXPECT_EQ(bounds.max_searches, 240);    // of 320
  EXPECT_EQ(bounds.finest_alignment_level, options.alignment.finest_level + 1);
  EXPECT_EQ(bounds.motion_iterations, 4);  // more than a fifth of 15
}

TEST(EffortBounds, EachLevelLeavesOutMore) {
  const TrackerOptions options;
  EffortBounds before = bounds_of(kTop, options);
  EXPECT_EQ(before.wanted_matches, options.local_map.wanted_matches);
  EXPECT_EQ(before.motion_iterations, options.pose.motion.max_iterations);
  for (int r = 1; r < kEffortLevels; ++r) {
    const EffortBounds now = bounds_of(static_cast<EffortLevel>(r), options);
    EXPECT_LE(now.max_searches, before.max_searches);
    EXPECT_GE(now.finest_alignment_level, before.finest_alignment_level);
    EXPECT_LE(now.motion_iterations, before.motion_iterations);
    EXPECT_GE(now.wanted_matches, options.pose.min_inliers);
    const bool less = now.max_searches < before.max_searches ||
                      now.finest_alignment_level > before.finest_alignment_level ||
                      now.motion_iterations < before.motion_iterations;
    EXPECT_EQ(less, r < static_cast<int>(kBottom));  // the last effort leaves out frames
    before = now;
  }
}

}  // namespace
}  // namespace twofold
