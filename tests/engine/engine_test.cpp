#include "engine/engine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <sstream>
#include <thread>

#include "engine/threaded_run.hpp"
#include "tests/engine/small_scene.hpp"

namespace twofold {
namespace {

using testing::small_rig;

/// A camera that sways through a textured room; rendered once for all tests.
class EngineTest : public ::testing::Test {
 protected:
  static constexpr int kFrames = 45;

  static SE3 T_c_w(int i) {
    const double s = 0.03 * i;
    return SE3(SO3::exp(Vector3(0.04 * std::sin(3 * s), 0.25 * std::sin(2 * s), 0.03 * std::sin(s))),
               Vector3(0.5 * std::sin(2 * s), 0.1 * std::sin(3 * s), -0.6 * s));
  }

  static void SetUpTestSuite() {
    frames_ = new std::vector<Frame>(testing::render_walk(T_c_w, 0, kFrames, 5));
  }
  static void TearDownTestSuite() {
    delete frames_;
    frames_ = nullptr;
  }

  static FrameFeed feed(int count = kFrames, FeedStatus last = FeedStatus::kEnd) {
    return [count, last, next = 0](Frame& frame) mutable {
      if (next == count) return last;
      frame = (*frames_)[static_cast<std::size_t>(next++)];
      return FeedStatus::kFrame;
    };
  }

  static RunResult run(const EngineOptions& options, const FrameFeed& frames = feed()) {
    std::atomic<bool> interrupted{false};
    return Engine(small_rig(), options).run(frames, interrupted);
  }

  static Schedule schedule_of(const RunResult& result) {
    std::stringstream file;
    EXPECT_TRUE(
        write_schedule(file, result.schedule.tracker, result.schedule.mapper, result.schedule.loop_closer));
    const auto schedule = read_schedule(file);
    EXPECT_TRUE(schedule) << schedule.error();
    return *schedule;
  }

  static void expect_same(const RunResult& a, const RunResult& b) {
    ASSERT_EQ(a.frames.size(), b.frames.size());
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      EXPECT_EQ(a.frames[i].state, b.frames[i].state) << i;
      EXPECT_EQ(a.frames[i].reference, b.frames[i].reference) << i;
      EXPECT_EQ(a.frames[i].snapshot_version, b.frames[i].snapshot_version) << i;
      EXPECT_EQ(a.frames[i].T_c_ref, b.frames[i].T_c_ref) << i;
      EXPECT_EQ(a.frames[i].T_c_w_causal, b.frames[i].T_c_w_causal) << i;
    }
    ASSERT_EQ(a.graph.keyframe_count(), b.graph.keyframe_count());
    ASSERT_EQ(a.graph.point_count(), b.graph.point_count());
    for (std::uint32_t k = 0; k < a.graph.keyframe_count(); ++k) {
      EXPECT_EQ(a.graph.T_k_w(KeyframeId{k}).matrix(), b.graph.T_k_w(KeyframeId{k}).matrix()) << k;
    }
    for (std::uint32_t p = 0; p < a.graph.point_count(); ++p) {
      EXPECT_EQ(a.graph.point(PointId{p}).psi, b.graph.point(PointId{p}).psi) << p;
    }
  }

  /// Largest distance between tracked and true camera positions, in the first camera's frame.
  static double worst_position_error(const RunResult& result) {
    double worst = 0;
    for (const FrameRecord& record : result.frames) {
      const SE3 T_c_first = final_T_c_w(record, result.graph) * result.graph.T_k_w(KeyframeId{0}).inverse();
      const SE3 T_c_first_true = T_c_w(static_cast<int>(record.frame_index)) * T_c_w(0).inverse();
      worst = std::max(worst,
                       (T_c_first.inverse().translation() - T_c_first_true.inverse().translation()).norm());
    }
    return worst;
  }

  static std::vector<Frame>* frames_;
};

std::vector<Frame>* EngineTest::frames_ = nullptr;

TEST_F(EngineTest, FollowsTheTrueCameraInEveryKindOfRun) {
  EngineOptions options;
  for (const bool deterministic : {true, false}) {
    options.deterministic = deterministic;
    const RunResult result = run(options);
    EXPECT_EQ(result.error, "");
    ASSERT_EQ(result.frames.size(), static_cast<std::size_t>(kFrames));
    for (const FrameRecord& record : result.frames) {
      EXPECT_EQ(record.state, FrameState::kTracked) << record.frame_index << ": " << describe(record.cause);
    }
    EXPECT_GE(result.graph.keyframe_count(), 3U);
    EXPECT_LT(worst_position_error(result), 0.01);  // of a path of about 1.5 m
  }
}

TEST_F(EngineTest, DeterministicRunsAreEqual) {
  EngineOptions options;
  options.deterministic = true;
  const RunResult first = run(options);
  expect_same(first, run(options));
}

TEST_F(EngineTest, ScheduleReplaysAThreadedRun) {
  for (const double speed : {0.0, 3.0}) {
    EngineOptions options;
    options.pacing.speed = speed;
    const RunResult live = run(options);
    ASSERT_EQ(live.error, "");
    std::atomic<bool> interrupted{false};
    const Schedule schedule = schedule_of(live);
    const RunResult replayed = Engine(small_rig(), options).replay(feed(), schedule, interrupted);
    EXPECT_EQ(replayed.error, "");
    expect_same(live, replayed);
    EXPECT_EQ(schedule_of(replayed), schedule);
  }
}

TEST_F(EngineTest, LateFramesAreDroppedOnRequestAndReplayed) {
  EngineOptions options;
  options.pacing.speed = 2000;  // far faster than any machine can follow
  options.pacing.late = LatePolicy::kDrop;
  const RunResult live = run(options);
  EXPECT_EQ(live.frames.size(), static_cast<std::size_t>(kFrames));
  const auto dropped = std::count_if(live.frames.begin(), live.frames.end(),
                                     [](const auto& record) { return record.state == FrameState::kDropped; });
  EXPECT_GT(dropped, 0);
  std::atomic<bool> interrupted{false};
  const RunResult replayed = Engine(small_rig(), options).replay(feed(), schedule_of(live), interrupted);
  EXPECT_EQ(replayed.error, "");
  expect_same(live, replayed);
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

TEST_F(EngineTest, ALateTrackerGoesDownTheLadderComesBackAndIsReplayed) {
  for (const LatePolicy late : {LatePolicy::kQueue, LatePolicy::kDrop}) {
    EngineOptions options;
    options.trace = true;
    options.pacing = {.speed = 1, .late = late};
    options.ladder.patience = 3;
    CostlyClock clock;
    std::atomic<bool> interrupted{false};
    ThreadedRun run(small_rig(), options, &clock);
    run.run(feed(), interrupted, {});
    const RunResult live = run.finish();
    ASSERT_EQ(live.error, "");
    ASSERT_EQ(live.frames.size(), static_cast<std::size_t>(kFrames));
    int lowest = 0;
    int before = 0;
    bool rose = false;
    for (const FrameRecord& record : live.frames) {
      const int rung = static_cast<int>(record.rung);
      EXPECT_LE(std::abs(rung - before), 1) << record.frame_index;  // step by step
      rose |= rung < before;
      lowest = std::max(lowest, rung);
      before = rung;
      if (record.state == FrameState::kDropped) continue;
      EXPECT_EQ(record.state, FrameState::kTracked) << describe(record.cause);
    }
    EXPECT_EQ(live.frames.front().rung, LadderRung::kEverything);
    EXPECT_EQ(lowest, kLadderRungs - 1);
    EXPECT_TRUE(rose);
    const auto dropped = std::count_if(live.frames.begin(), live.frames.end(),
                                       [](const auto& r) { return r.state == FrameState::kDropped; });
    EXPECT_EQ(dropped > 0, late == LatePolicy::kDrop);
    if (late == LatePolicy::kDrop) {
      EXPECT_EQ(live.frames.back().rung, LadderRung::kEverything);
    }
    std::ostringstream trace;
    ASSERT_TRUE(live.trace->write(trace));
    EXPECT_NE(trace.str().find("load ladder rung"), std::string::npos);

    const Schedule schedule = schedule_of(live);
    const RunResult replayed = Engine(small_rig(), options).replay(feed(), schedule, interrupted);
    EXPECT_EQ(replayed.error, "");
    expect_same(live, replayed);
    EXPECT_EQ(schedule_of(replayed), schedule);
    for (std::size_t i = 0; i < live.frames.size(); ++i)
      EXPECT_EQ(live.frames[i].rung, replayed.frames[i].rung) << i;
  }
}

TEST_F(EngineTest, ReplayRefusesARungItDoesNotKnow) {
  EngineOptions options;
  Schedule schedule = schedule_of(run(options));
  schedule.tracker[3].degrade_level = kLadderRungs;
  std::atomic<bool> interrupted{false};
  const RunResult replayed = Engine(small_rig(), options).replay(feed(), schedule, interrupted);
  EXPECT_NE(replayed.error.find("rung of the load ladder"), std::string::npos);
}

TEST_F(EngineTest, ReplayRefusesAnotherRecording) {
  EngineOptions options;
  const RunResult live = run(options);
  std::atomic<bool> interrupted{false};
  const RunResult replayed =
      Engine(small_rig(), options).replay(feed(kFrames / 2), schedule_of(live), interrupted);
  EXPECT_NE(replayed.error.find("more frames than the input"), std::string::npos);
}

TEST_F(EngineTest, KeepsWhatItHasWhenInterruptedOrTheInputBreaks) {
  for (const bool deterministic : {true, false}) {
    EngineOptions options;
    options.deterministic = deterministic;
    std::atomic<bool> interrupted{false};
    int seen = 0;
    const ProgressSink stop_after_ten = [&](const Progress&) { interrupted = ++seen >= 10; };
    const RunResult stopped = Engine(small_rig(), options).run(feed(), interrupted, stop_after_ten);
    EXPECT_TRUE(stopped.interrupted);
    EXPECT_GE(stopped.frames.size(), 10U);
    EXPECT_LT(stopped.frames.size(), static_cast<std::size_t>(kFrames));
    EXPECT_GE(stopped.graph.keyframe_count(), 1U);

    const RunResult broken = run(options, feed(20, FeedStatus::kError));
    EXPECT_EQ(broken.error, "the input ended with an error");
    EXPECT_EQ(broken.frames.size(), 20U);
  }
}

TEST_F(EngineTest, ReportsLostFramesAndRecovers) {
  EngineOptions options;
  options.deterministic = true;
  const FrameFeed covered = [next = 0](Frame& frame) mutable {
    if (next == kFrames) return FeedStatus::kEnd;
    frame = (*frames_)[static_cast<std::size_t>(next)];
    if (next >= 20 && next < 23) {  // a hand over the lens
      frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
      frame.right = frame.left;
    }
    ++next;
    return FeedStatus::kFrame;
  };
  const RunResult result = run(options, covered);
  for (const FrameRecord& record : result.frames) {
    const bool hidden = record.frame_index >= 20 && record.frame_index < 23;
    EXPECT_EQ(record.state, hidden ? FrameState::kLost : FrameState::kTracked) << record.frame_index;
    EXPECT_EQ(record.cause == LostCause::kNone, !hidden) << record.frame_index;
  }
}

TEST_F(EngineTest, RefusesAMonocularRig) {
  Rig rig = small_rig();
  rig.kind = SensorKind::kMono;
  EXPECT_THROW(Engine(rig, {}), std::runtime_error);
}

}  // namespace
}  // namespace twofold
