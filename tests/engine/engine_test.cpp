#include "engine/engine.hpp"

#include <gtest/gtest.h>

#include <atomic>

#include "fixtures/corner_walk.hpp"
#include "geometry/absolute_orientation.hpp"
#include "tests/engine/swaying_camera.hpp"

namespace twofold {
namespace {

using testing::expect_replay;
using testing::expect_same;
using testing::replay_engine;
using testing::schedule_of;
using testing::small_rig;
using EngineTest = testing::SwayingCamera;

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

TEST_F(EngineTest, AScheduleIsFollowedOverItsOwnInputOnly) {
  EngineOptions options;
  options.deterministic = true;
  const Schedule schedule = schedule_of(run(options));
  const auto error_over = [&](const Rig& rig, const FrameFeed& frames) {
    const std::atomic<bool> interrupted{false};
    return Engine(rig, {}).replay(frames, schedule, interrupted).error;
  };
  const FrameFeed same = feed();
  EXPECT_EQ(error_over(small_rig(), same), "");
  const FrameFeed other = [frames = feed()](Frame& frame) {
    const FrameStatus status = frames(frame);
    frame.left = frame.left.clone();
    frame.left.at<std::uint8_t>(10, 10) ^= 1;
    return status;
  };
  EXPECT_NE(error_over(small_rig(), other).find("another recording"), std::string::npos);
  Rig rig = small_rig();
  rig.camera.fx += 0.01;
  EXPECT_NE(error_over(rig, feed()).find("another rig"), std::string::npos);
}

TEST_F(EngineTest, ScheduleReplaysAThreadedRun) {
  for (const double speed : {0.0, 3.0}) {
    EngineOptions options;
    options.pacing.speed = speed;
    const RunResult live = run(options);
    ASSERT_EQ(live.error, "");
    expect_replay(options, feed(), live);
  }
}

TEST_F(EngineTest, ReplayRefusesAnotherRecording) {
  EngineOptions options;
  const RunResult live = run(options);
  const RunResult replayed = replay_engine(options, feed(kFrames / 2), schedule_of(live));
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

    const RunResult broken = testing::run_engine(options, feed(20, FrameStatus::kError));
    EXPECT_EQ(broken.error, "the input ended with an error");
    EXPECT_EQ(broken.frames.size(), 20U);
  }
}

TEST_F(EngineTest, ReportsLostFramesAndRecovers) {
  EngineOptions options;
  options.deterministic = true;
  const FrameFeed covered = [next = 0](Frame& frame) mutable {
    if (next == kFrames) return FrameStatus::kEnd;
    frame = (*frames_)[static_cast<std::size_t>(next)];
    if (next >= 20 && next < 23) {  // a hand over the lens
      frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
      frame.right = frame.left;
    }
    ++next;
    return FrameStatus::kFrame;
  };
  const RunResult result = testing::run_engine(options, covered);
  for (const FrameRecord& record : result.frames) {
    const bool hidden = record.frame_index >= 20 && record.frame_index < 23;
    EXPECT_EQ(record.state, hidden ? FrameState::kLost : FrameState::kTracked) << record.frame_index;
    EXPECT_EQ(record.cause == LostCause::kNone, !hidden) << record.frame_index;
  }
}

TEST(Engine, OneCameraIsFollowedUpToScale) {
  const std::vector<Frame> frames = testing::render_walk(testing::corner_walk, 0, 40, 5);
  Rig rig = small_rig();
  rig.kind = SensorKind::kMono;
  rig.baseline = 0;
  for (const bool deterministic : {true, false}) {
    EngineOptions options;
    options.deterministic = deterministic;
    const std::atomic<bool> interrupted{false};
    const auto feed = [&]() -> FrameFeed {
      return [&, next = std::size_t{0}](Frame& frame) mutable {
        if (next == frames.size()) return FrameStatus::kEnd;
        frame = frames[next++];
        return FrameStatus::kFrame;
      };
    };
    const RunResult result = Engine(rig, options).run(feed(), interrupted);
    EXPECT_EQ(result.error, "");
    if (!deterministic) {
      const Schedule schedule = testing::schedule_of(result);
      testing::expect_same(result, Engine(rig, options).replay(feed(), schedule, interrupted));
    }
    std::vector<Vector3> estimated, truth;
    int placed_later = 0;
    for (const FrameRecord& record : result.frames) {
      EXPECT_TRUE(estimated.empty() || has_final_pose(record)) << record.frame_index;
      if (!has_final_pose(record)) continue;
      // Frames before the start, which says where they were.
      placed_later += record.state == FrameState::kPlacedLater;
      EXPECT_TRUE(record.state == FrameState::kTracked ||
                  placed_later == static_cast<int>(estimated.size()) + 1);
      estimated.push_back(final_T_c_w(record, result.graph).inverse().translation());
      truth.push_back(testing::corner_walk(static_cast<int>(record.frame_index)).inverse().translation());
    }
    EXPECT_GE(placed_later, 2);
    EXPECT_EQ(estimated.size(), result.frames.size());
    const auto S = align_similarity(truth, estimated);
    ASSERT_TRUE(S);
    for (std::size_t n = 0; n < truth.size(); ++n) EXPECT_LT((*S * estimated[n] - truth[n]).norm(), 0.02);
  }
}

}  // namespace
}  // namespace twofold
