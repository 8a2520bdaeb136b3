// Runs that are given their frames one at a time, and who is told of each pose.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <vector>

#include "engine/lockstep_run.hpp"
#include "engine/runners.hpp"
#include "engine/threaded_run.hpp"
#include "graph/graph_writer.hpp"
#include "tests/engine/swaying_camera.hpp"

namespace twofold {
namespace {

using testing::expect_replay;
using testing::expect_same;
using testing::small_rig;

constexpr auto kLongest = std::chrono::minutes(5);

class EnginePushTest : public testing::SwayingCamera {
 protected:
  static EngineOptions stepped() {
    EngineOptions options;
    options.stepped = true;
    return options;
  }
  static const Frame& frame(std::size_t i) { return frames_->at(i); }

  static void wait_for_room(SteppedRun& run, const FrameSink& sink = {}) {
    while (!run.has_room()) {
      run.collect(sink);
      ASSERT_FALSE(run.failed());
      if (run.has_room()) return;  // with nothing left to collect, nobody would end the wait
      run.wait(std::chrono::steady_clock::now() + kLongest);
    }
  }
};

TEST_F(EnginePushTest, PushedFramesAreCollectedInOrderAndReplay) {
  ThreadedRun run(small_rig(), {});
  std::vector<std::int64_t> collected;
  const FrameSink sink = [&](const FrameRecord& record, const PoseCorrection&) {
    EXPECT_EQ(record.state, FrameState::kTracked) << describe(record.cause);
    collected.push_back(record.frame_index);
  };
  for (std::size_t i = 0; i < kFrames; ++i) {
    wait_for_room(run, sink);
    run.push(frame(i));
  }
  run.stop();
  run.collect(sink);
  EXPECT_EQ(run.progress().frames, kFrames);
  const RunResult result = run.finish();
  EXPECT_EQ(result.error, "");
  ASSERT_EQ(result.frames.size(), static_cast<std::size_t>(kFrames));
  ASSERT_EQ(collected.size(), result.frames.size());
  for (std::size_t i = 0; i < collected.size(); ++i) EXPECT_EQ(collected[i], static_cast<std::int64_t>(i));
  expect_replay({}, feed(), result);
}

TEST_F(EnginePushTest, AFullRunTakesNoMoreAndNeverBlocks) {
  std::atomic<bool> may_go_on{false};
  EngineOptions options;
  options.frame_slots = 4;
  options.on_pose = [&](const PoseReport&) {
    may_go_on.wait(false, std::memory_order_acquire);  // what a listener must never do: it holds the tracker
  };
  ThreadedRun run(small_rig(), options);
  std::size_t pushed = 0;
  for (; run.has_room(); ++pushed) run.push(frame(pushed));
  EXPECT_EQ(pushed, options.frame_slots);
  may_go_on.store(true, std::memory_order_release);
  may_go_on.notify_all();
  wait_for_room(run);
  run.push(frame(pushed++));
  run.stop();
  run.collect({});
  EXPECT_EQ(run.progress().frames, static_cast<std::int64_t>(pushed));
}

TEST_F(EnginePushTest, TheListenerHearsOfEveryPoseOnTheTrackersThread) {
  struct Heard {
    std::int64_t frame;
    PackedPose T_c_w;
    std::uint64_t version_said, version_given;
    std::int64_t latency_ns;
  };
  for (const bool deterministic : {true, false}) {
    std::vector<Heard> heard;
    std::set<std::thread::id> threads;
    EngineOptions options;
    options.deterministic = deterministic;
    options.on_pose = [&](const PoseReport& report) {
      const FrameRecord& record = report.record;
      heard.push_back({record.frame_index, record.T_c_w_causal, record.snapshot_version,
                       report.graph.version(), record.latency_ns});
      threads.insert(std::this_thread::get_id());
    };
    const RunResult result = testing::run_engine(options, feed());
    ASSERT_EQ(heard.size(), result.frames.size());
    for (std::size_t i = 0; i < heard.size(); ++i) {
      EXPECT_EQ(heard[i].frame, result.frames[i].frame_index);
      EXPECT_EQ(heard[i].T_c_w, result.frames[i].T_c_w_causal);
      EXPECT_EQ(heard[i].version_said, heard[i].version_given);
      EXPECT_EQ(heard[i].latency_ns, result.frames[i].latency_ns);
    }
    EXPECT_EQ(threads.size(), 1U);
    EXPECT_EQ(threads.contains(std::this_thread::get_id()), deterministic);
    EXPECT_EQ(result.times.front().to_json()["pose listener"]["count"], kFrames);
  }
}

TEST_F(EnginePushTest, PosesAreToldBeforeTheFrameIsDone) {
  for (const bool deterministic : {true, false}) {
    std::vector<FrameRecord> poses, done;
    std::int64_t later_ns = 0;
    EngineOptions options;
    options.deterministic = deterministic;
    options.on_pose = [&](const PoseReport& report) { poses.push_back(report.record); };
    options.on_frame = [&](const PoseReport& report) {
      ASSERT_EQ(poses.size(), done.size() + 1);
      done.push_back(report.record);
      EXPECT_EQ(done.back().frame_index, poses.back().frame_index);
      EXPECT_EQ(done.back().keyframe, poses.back().keyframe);
      EXPECT_EQ(done.back().T_c_w_causal, poses.back().T_c_w_causal);
      const std::int64_t rest_ns = done.back().tracking_ns - poses.back().tracking_ns;
      EXPECT_GE(rest_ns, 0);
      if (report.record.keyframe && report.record.frame_index > 0) later_ns += rest_ns;
    };
    (void)testing::run_engine(options, feed());
    EXPECT_EQ(done.size(), kFrames);
    EXPECT_GT(later_ns, 0) << "nothing is left to be done after the pose, not even in keyframes";
  }
}

TEST_F(EnginePushTest, TheListenerHearsWherePointsWereSearched) {
  const Rig rig = small_rig();
  int points = 0;
  EngineOptions options;
  options.deterministic = true;
  options.on_pose = [&](const PoseReport& report) {
    if (report.record.state != FrameState::kTracked) return;
    for (const MotionObservation& found : report.measured) {
      const Vector2 predicted = rig.camera.project(report.searched.T_c_ref * found.x_ref);
      const double level_size = std::sqrt(rig.information(found.pixel, 0)[0] / found.information[0]);
      const Vector2 away = found.pixel.head<2>().cast<double>() - predicted;
      constexpr double kRefined = 1.5;  // the place found may be refined by so much
      EXPECT_LE(away.cwiseAbs().maxCoeff(), level_size * (report.searched.radius_px + kRefined));
      ++points;
    }
  };
  (void)testing::run_engine(options, feed());
  EXPECT_GT(points, 50 * kFrames);
}

TEST_F(EnginePushTest, StepsAreTakenByTheCallersThreadsAndReplay) {
  SteppedRun run(small_rig(), stepped());
  std::atomic<bool> done{false};
  std::array<std::atomic<int>, 3> taken{};
  const auto take = [&](PipelineStep step) {
    while (!done.load()) {
      if (run.step(step)) ++taken.at(static_cast<std::size_t>(step));
    }
  };
  {
    // Two that want the same step: they take turns.
    const std::jthread tracker(take, PipelineStep::kTrack), another(take, PipelineStep::kTrack);
    const std::jthread mapper(take, PipelineStep::kMap), loop_closer(take, PipelineStep::kCloseLoops);
    for (std::size_t i = 0; i < kFrames; ++i) {
      wait_for_room(run);
      run.push(frame(i));
    }
    done = true;
  }
  run.stop();  // takes what is left
  const RunResult result = run.finish();
  EXPECT_EQ(result.error, "");
  EXPECT_EQ(result.counts.tracked, kFrames);
  for (const std::atomic<int>& steps : taken) EXPECT_GT(steps, 0);
  expect_replay({}, feed(), result);
}

TEST_F(EnginePushTest, StepsInOneOrderGiveTheSameBytes) {
  std::vector<RunResult> results;
  for (int i = 0; i < 2; ++i) {
    SteppedRun run(small_rig(), stepped());
    EXPECT_FALSE(run.step(PipelineStep::kTrack)) << "no frame was pushed yet";
    for (std::size_t k = 0; k < kFrames; ++k) {
      run.collect({});
      ASSERT_TRUE(run.has_buffer());
      run.push(frame(k));
      EXPECT_TRUE(run.step(PipelineStep::kTrack));
      EXPECT_FALSE(run.step(PipelineStep::kTrack));
      if (k % 5 != 0) continue;  // the map's steps come late, and together
      while (run.step(PipelineStep::kMap) || run.step(PipelineStep::kCloseLoops)) {
      }
    }
    run.stop();
    EXPECT_FALSE(run.step(PipelineStep::kMap));
    results.push_back(run.finish());
  }
  EXPECT_EQ(results[0].counts.tracked, kFrames);
  EXPECT_GT(results[0].graph.keyframe_count(), 1U);
  expect_same(results[0], results[1]);
}

/// What an event says of a version must be known by the time that the tracker sees it.
TEST_F(EnginePushTest, EachVersionOfTheMapIsToldBeforeItIsPublished) {
  EngineOptions options = stepped();
  std::vector<std::uint64_t> next, published;
  options.on_next_map = [&](const GraphSnapshot& graph, const DoubleWindow&) {
    next.push_back(graph.version());
  };
  options.on_map = [&](const GraphSnapshot& graph, const DoubleWindow&) {
    published.push_back(graph.version());
    EXPECT_EQ(next, published);
  };
  SteppedRun run(small_rig(), options);
  for (std::size_t k = 0; k < kFrames; ++k) {
    run.collect({});
    run.push(frame(k));
    while (run.step(PipelineStep::kTrack) || run.step(PipelineStep::kMap)) {
    }
  }
  run.stop();
  (void)run.finish();
  EXPECT_GT(published.size(), 2U);
  EXPECT_EQ(next, published);
}

// Keyframes that found the loop closer's ring full must not keep the buffers of a replay.
TEST_F(EnginePushTest, ARunWhoseLoopCloserRestsForManyKeyframesReplays) {
  constexpr int kLong = 160;
  EngineOptions options = stepped();
  options.tracker.keyframes.tracked_share = 1;       // nearly every frame is one
  options.mapper.culling.keep_replacements = 1'000;  // the maps are compared whole
  const auto there_and_back = [](int i) {
    const int n = i % (2 * kFrames - 2);
    Frame seen = frame(static_cast<std::size_t>(n < kFrames ? n : 2 * kFrames - 2 - n));
    testing::number_frame(seen, i);
    return seen;
  };
  SteppedRun run(small_rig(), options);
  for (int i = 0; i < kLong; ++i) {
    run.collect({});
    run.push(there_and_back(i));
    (void)run.step(PipelineStep::kTrack);
    (void)run.step(PipelineStep::kMap);
  }
  run.stop();
  const RunResult result = run.finish();
  ASSERT_GT(result.keyframes_not_described, 70U);
  const FrameFeed again = [&, next = 0](Frame& seen) mutable {
    if (next == kLong) return FrameStatus::kEnd;
    seen = there_and_back(next++);
    return FrameStatus::kFrame;
  };
  const RunResult replayed = expect_replay(options, again, result);
  EXPECT_EQ(replayed.keyframes_not_described, result.keyframes_not_described);
}

TEST_F(EnginePushTest, AStepThatFailsEndsASteppedRunAndTellsWhoTookIt) {
  EngineOptions options = stepped();
  options.before_step = [](std::string_view step) {
    if (step == "mapper") throw std::runtime_error("out of order");
  };
  SteppedRun run(small_rig(), options);
  wait_for_room(run);
  run.push(frame(0));
  EXPECT_TRUE(run.step(PipelineStep::kTrack));
  EXPECT_FALSE(run.failed());
  EXPECT_THROW((void)run.step(PipelineStep::kMap), std::runtime_error);
  EXPECT_TRUE(run.failed());
  EXPECT_FALSE(run.step(PipelineStep::kMap));
  run.stop();
  const RunResult result = run.finish();
  EXPECT_EQ(result.error, "mapper: out of order");
  EXPECT_EQ(result.counts.tracked, 1);
}

TEST_F(EnginePushTest, AStepThatFailsEndsALockstepRun) {
  EngineOptions options;
  options.deterministic = true;
  int versions = 0;
  options.on_map = [&versions](const GraphSnapshot&, const DoubleWindow&) {
    if (++versions == 2) throw std::runtime_error("out of order");  // with the first keyframe
  };
  LockstepRun run(small_rig(), options);
  EXPECT_THROW(run.push(frame(0)), std::runtime_error);
  EXPECT_TRUE(run.failed());
  for (std::size_t i = 1; i < kFrames; ++i) run.push(frame(i));
  run.stop();
  const RunResult result = run.finish();
  EXPECT_EQ(result.error, "out of order");
  EXPECT_EQ(result.counts.frames, 1) << "what came after the failure was not tracked";
}

TEST_F(EnginePushTest, ALockstepRunTakesOneFrameAtATime) {
  EngineOptions options;
  options.deterministic = true;
  LockstepRun run(small_rig(), options);
  int collected = 0;
  for (std::size_t i = 0; i < kFrames; ++i) {
    run.push(frame(i));
    run.collect([&](const FrameRecord& record, const PoseCorrection&) {
      EXPECT_EQ(record.frame_index, static_cast<std::int64_t>(i));
      EXPECT_EQ(record.state, FrameState::kTracked);
      ++collected;
    });
  }
  EXPECT_EQ(collected, kFrames);
  expect_same(run.finish(), testing::run_engine(options, feed()));
}

/// Tracker and mapper by turns.
class PoseCorrectionTest : public testing::SwayingCamera {
 protected:
  PoseCorrection look(const Frame& frame) {
    FrameRecord record;
    ProposalHandle proposal = pool_.try_acquire();
    tracking_.locate(frame, graph_, EffortLevel::kEverything, proposal, record);
    tracking_.tell(0, 0, record);
    const bool proposed = tracking_.prepare_next(record);
    state_ = record.state;
    if (proposed) {
      (void)mapping_.step({&proposal, 1});
      graph_ = mapping_.publish();
    }
    return tracking_.correction();
  }
  /// A hand over the lens.
  PoseCorrection look_at_nothing(int index) {
    Frame frame;
    frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(12));
    frame.right = frame.left;
    testing::number_frame(frame, index);
    return look(frame);
  }
  /// A version of the map in which all keyframes stand farther to the right.
  void move_map(double distance) {
    GraphWriter writer(graph_);
    for (std::uint32_t k = 0; k < graph_.keyframe_count(); ++k) {
      const SE3 T_k_w = graph_.keyframe(KeyframeId{k}).T_k_w;
      writer.set_pose(KeyframeId{k}, T_k_w * SE3(SO3(), Vector3(-distance, 0, 0)));
    }
    graph_ = writer.publish();
  }

  EngineOptions options_;
  TrackerRunner tracking_{small_rig(), options_, nullptr};
  MapperRunner mapping_{small_rig(), options_, nullptr};
  ProposalPool pool_{6};
  GraphSnapshot graph_ = mapping_.publish();
  FrameState state_ = FrameState::kLost;
};

TEST_F(PoseCorrectionTest, ALostCameraIsToldOfEachCorrectionOnce) {
  constexpr int kTracked = 5;
  for (std::size_t i = 0; i < kTracked; ++i) (void)look((*frames_)[i]);
  ASSERT_EQ(state_, FrameState::kTracked);
  move_map(0.05);
  const PoseCorrection first = look_at_nothing(kTracked);
  ASSERT_EQ(state_, FrameState::kLost);
  EXPECT_EQ(first.reason, CorrectionReason::kOptimisation);
  EXPECT_EQ(look_at_nothing(kTracked + 1).reason, CorrectionReason::kNone) << "the map is the same";
  move_map(0.03);
  const PoseCorrection second = look_at_nothing(kTracked + 2);
  EXPECT_EQ(second.reason, CorrectionReason::kOptimisation);
  EXPECT_EQ(second.T_c_w_before, first.T_c_w_after);
  const Vector3 moved = second.T_c_w_after.unpacked().inverse().translation() -
                        second.T_c_w_before.unpacked().inverse().translation();
  EXPECT_NEAR(moved.norm(), 0.03, 1e-6);
  EXPECT_EQ(look_at_nothing(kTracked + 3).reason, CorrectionReason::kNone);
}

}  // namespace
}  // namespace twofold
