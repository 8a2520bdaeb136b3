// Runs that keep a pace: late frames, the effort levels, and their replays.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <sstream>
#include <thread>

#include "engine/threaded_run.hpp"
#include "tests/engine/swaying_camera.hpp"

namespace twofold {
namespace {

using testing::expect_replay;
using testing::replay_engine;
using testing::schedule_of;
using testing::small_rig;
using EnginePaceTest = testing::SwayingCamera;

TEST_F(EnginePaceTest, LateFramesAreDroppedOnRequestAndReplayed) {
  EngineOptions options;
  options.pacing.speed = 2000;  // far faster than any machine can follow
  options.pacing.late = LatePolicy::kDrop;
  const RunResult live = run(options);
  EXPECT_EQ(live.frames.size(), static_cast<std::size_t>(kFrames));
  const auto dropped = std::count_if(live.frames.begin(), live.frames.end(),
                                     [](const auto& record) { return record.state == FrameState::kDropped; });
  EXPECT_GT(dropped, 0);
  expect_replay(options, feed(), live);
  Progress last;
  std::atomic<bool> interrupted{false};
  (void)Engine(small_rig(), options).replay(feed(), schedule_of(live), interrupted, [&](const Progress& p) {
    last = p;
  });
  EXPECT_EQ(last.frames, kFrames);
  EXPECT_EQ(last.dropped, dropped);
}

TEST_F(EnginePaceTest, EveryProposedKeyframeReachesTheMapHoweverShortTheQueueIs) {
  EngineOptions options;
  options.pacing.speed = 2000;
  options.proposal_slots = 1;
  const RunResult live = run(options);
  const auto proposed = std::count_if(live.frames.begin(), live.frames.end(),
                                      [](const auto& record) { return record.keyframe; });
  EXPECT_GE(proposed, 2);
  EXPECT_EQ(live.graph.keyframe_count(), static_cast<std::size_t>(proposed));
  expect_replay(options, feed(), live);
}

TEST_F(EnginePaceTest, TheTrackerHasTheRightOfWayOverThreadsOfTheCallersWhereThereIsAPace) {
  RightOfWay right;
  std::atomic<int> told{0}, taken{0};
  EngineOptions options;
  options.right_of_way = &right;
  options.on_pose = options.on_frame = [&](const PoseReport&) {
    ++told;
    taken += right.taken();
  };
  options.pacing.speed = 200;
  (void)run(options);
  EXPECT_GE(told, 2 * kFrames);
  EXPECT_EQ(taken, told);
  EXPECT_FALSE(right.taken());
  told = taken = 0;
  options.pacing.speed = 0;  // the tracker never rests
  (void)run(options);
  EXPECT_GE(told, 2 * kFrames);
  EXPECT_EQ(taken, 0);
}

/// Time stamps jump by a day: the run waits for that, but not when it is told to end.
TEST_F(EnginePaceTest, AnInterruptDoesNotWaitForFramesThatAreStillToCome) {
  for (const int after :
       {3, kFrames - 2}) {  // the recording goes on for long, or it has been read to its end
    const FrameFeed all = feed();
    std::atomic<bool> interrupted{false};
    const FrameFeed jumping = [&](Frame& frame) {
      const FrameStatus status = all(frame);
      if (frame.index >= after) frame.t_ns += 86'400LL * 1'000'000'000;
      return status;
    };
    EngineOptions options;
    options.pacing.speed = 1000;
    std::atomic<int> tracked{0};
    options.on_pose = [&](const PoseReport&) { ++tracked; };
    std::jthread user([&](const std::stop_token& stop) {
      while (tracked < after && !stop.stop_requested()) std::this_thread::yield();
      interrupted = true;
    });
    const auto start = std::chrono::steady_clock::now();
    const RunResult result = Engine(small_rig(), options).run(jumping, interrupted);
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(40))
        << "waited for a day at 1000";
    EXPECT_TRUE(result.interrupted);
    EXPECT_GE(result.frames.size(), static_cast<std::size_t>(after));
    for (const FrameRecord& record : result.frames) EXPECT_GE(record.latency_ns, 0);
  }
}

/// Time passes when it is read, which is two or three times a frame, and for a while more than a frame has.
class CostlyClock : public PacingClock {
 public:
  std::int64_t now_ns() override {
    ++readings_;
    return now_ += readings_ > 20 && readings_ <= 32 ? 25'000'000 : 2'000'000;
  }
  void sleep_until(std::int64_t t_ns, const std::stop_token&) override {
    std::this_thread::sleep_for(std::chrono::milliseconds(3));  // the mapper's time is real
    now_ = std::max(now_, t_ns);
  }

 private:
  std::int64_t now_ = 1'000'000'000;
  int readings_ = 0;
};

TEST_F(EnginePaceTest, ALateTrackerGoesDownTheLevelsComesBackAndIsReplayed) {
  for (const LatePolicy late : {LatePolicy::kQueue, LatePolicy::kDrop}) {
    EngineOptions options;
    options.trace = true;
    options.pacing = {.speed = 1, .late = late};
    options.effort.patience = 3;
    CostlyClock clock;
    std::atomic<bool> interrupted{false};
    ThreadedRun run(small_rig(), options, &clock);
    const RunResult live = feed_all(run, feed(), interrupted);
    ASSERT_EQ(live.error, "");
    ASSERT_EQ(live.frames.size(), static_cast<std::size_t>(kFrames));
    int lowest = 0;
    int before = 0;
    bool rose = false;
    for (const FrameRecord& record : live.frames) {
      const int effort = static_cast<int>(record.effort);
      EXPECT_LE(std::abs(effort - before), 1) << record.frame_index;  // step by step
      rose |= effort < before;
      lowest = std::max(lowest, effort);
      before = effort;
      if (record.state == FrameState::kDropped) continue;
      EXPECT_EQ(record.state, FrameState::kTracked) << describe(record.cause);
    }
    EXPECT_EQ(live.frames.front().effort, EffortLevel::kEverything);
    EXPECT_EQ(lowest, kEffortLevels - 1);
    EXPECT_TRUE(rose);
    const auto dropped = std::count_if(live.frames.begin(), live.frames.end(),
                                       [](const auto& r) { return r.state == FrameState::kDropped; });
    EXPECT_EQ(dropped > 0, late == LatePolicy::kDrop);
    if (late == LatePolicy::kDrop) {
      EXPECT_EQ(live.frames.back().effort, EffortLevel::kEverything);
    }
    std::ostringstream trace;
    ASSERT_TRUE(live.trace->write(trace));
    EXPECT_NE(trace.str().find("effort level"), std::string::npos);

    expect_replay(options, feed(), live);
  }
}

TEST_F(EnginePaceTest, ReplayRefusesALevelItDoesNotKnow) {
  EngineOptions options;
  Schedule schedule = schedule_of(run(options));
  schedule.tracker[3].effort_level = kEffortLevels;
  const RunResult replayed = replay_engine(options, feed(), schedule);
  EXPECT_NE(replayed.error.find("effort level"), std::string::npos);
}

}  // namespace
}  // namespace twofold
