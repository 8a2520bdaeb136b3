// What `twofold run` is told by --speed, --late, --checkpoint and --trace, and the viewer's pause, of the
// library.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>
#include <vector>

#include "engine/clock.hpp"
#include "graph/map_file.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/slam/slam_run.hpp"

namespace twofold {
namespace {

class SlamModesTest : public testing::SlamRun {
 protected:
  /// The frame as a camera would give it now.
  static FrameView taken_now(std::size_t i) {
    FrameView frame = view(i);
    frame.t_ns = steady_now_ns();
    return frame;
  }

  /// Frames that came while the tracker was held up by the first one, as SlamOptions::late says.
  static SlamSummary summary_of_late_frames(const SlamOptions& options) {
    constexpr std::size_t kWaiting = 6;
    std::atomic<bool> held_up{false}, all_wait{false};
    Slam slam(rig(), options);
    slam.on_pose([&](const PoseEstimate&) {
      held_up = true;
      held_up.notify_all();
      all_wait.wait(false);
    });
    for (std::size_t i = 0; i < kWaiting; ++i) {
      EXPECT_TRUE(slam.push(options.live ? taken_now(i) : view(i)));
      held_up.wait(false);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));  // all are due, one after the other
    }
    all_wait = true;
    all_wait.notify_all();
    return slam.finish();
  }
};

TEST_F(SlamModesTest, ARecordingIsTrackedAtItsOwnPace) {
  constexpr double kSpeed = 4;
  std::vector<PoseEstimate> poses;
  Slam slam(rig(), {.speed = kSpeed});
  slam.on_pose([&](const PoseEstimate& pose) { poses.push_back(pose); });
  push_all(slam);
  EXPECT_EQ(slam.finish().tracked, kFrames);
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(kFrames));
  for (std::size_t i = 1; i < poses.size(); ++i) {
    const auto passed = static_cast<double>(view(i).t_ns - view(0).t_ns) / kSpeed;
    EXPECT_NEAR(static_cast<double>(poses[i].exposed_ns - poses[0].exposed_ns), passed, 2) << i;
    EXPECT_GT(poses[i].latency_ns, 0) << "not before it was taken";
  }
}

/// At this speed they are due half a minute after each other.
TEST_F(SlamModesTest, WhoWantsTheEndWaitsForNoPace) {
  constexpr double kSlow = 0.002;
  constexpr std::size_t kPushed = 5;
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  {
    Slam slam(rig(), {.speed = kSlow});
    push_all(slam, 0, kPushed);
    std::thread other([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(300));  // by then finish waits
      slam.end_pace();
    });
    EXPECT_EQ(slam.finish().tracked, kPushed);
    other.join();
    slam.end_pace();  // with nothing left to be paced
  }
  {
    Slam slam(rig(), {.speed = kSlow});
    push_all(slam, 0, kPushed);
  }
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(20));
}

TEST_F(SlamModesTest, WhatBecomesOfLateFramesIsTheUsersChoice) {
  for (const bool live : {true, false}) {
    const SlamOptions paced{.live = live, .speed = live ? 0 : 100.0};
    const auto with = [&](LateFrames late) {
      SlamOptions options = paced;
      options.late = late;
      return summary_of_late_frames(options);
    };
    EXPECT_EQ(with(LateFrames::kQueue).dropped, 0) << live;
    EXPECT_EQ(with(LateFrames::kNewest).dropped, 4)
        << live;  // between the first, which held it up, and the last
    EXPECT_GT(with(LateFrames::kDrop).dropped, 0) << live;
    EXPECT_EQ(summary_of_late_frames(paced).dropped, live ? 4 : 0) << live;
  }
}

TEST_F(SlamModesTest, WhileMappingIsPausedTheMapStaysAsItIs) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    std::vector<std::int64_t> keyframes;
    Slam slam(rig(), {.mode = mode});
    slam.on_pose([&](const PoseEstimate& pose) {
      if (pose.keyframe) keyframes.push_back(pose.frame);
      if (pose.frame == 10) slam.pause_mapping(true);
      if (pose.frame == 35) slam.pause_mapping(false);
    });
    push_all(slam);
    EXPECT_EQ(slam.finish().tracked, kFrames);
    const auto between = [&](std::int64_t begin, std::int64_t end) {
      return std::count_if(keyframes.begin(), keyframes.end(),
                           [&](std::int64_t frame) { return frame >= begin && frame < end; });
    };
    EXPECT_GT(between(0, 11), 0);
    EXPECT_EQ(between(12, 36), 0);
    EXPECT_GT(between(36, kFrames), 0);
  }
}

TEST_F(SlamModesTest, CheckpointsAreMapsThatAnotherRunGoesOnWith) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    const ScratchFolder folder;
    const auto file = folder.path() / "checkpoint.tfm";
    std::size_t keyframes = 0;
    {
      SlamOptions options{.mode = mode, .checkpoint = file, .checkpoint_period = 0.2};
      if (mode == RunMode::kThreaded) options.speed = 1;
      Slam slam(rig(), options);
      push_all(slam);
      EXPECT_TRUE(std::filesystem::exists(file)) << "while the run goes on";
      EXPECT_TRUE(slam.finish().errors.empty());
      keyframes = load_map(file).graph.keyframe_count();
      EXPECT_GT(keyframes, 0U);
      EXPECT_LE(keyframes, slam.map().keyframes().size());
    }
    Slam localising(rig(), {.mode = RunMode::kDeterministic, .map = file, .localise_only = true});
    push_all(localising);
    EXPECT_GT(localising.finish().tracked, kFrames / 2);
  }
}

TEST_F(SlamModesTest, ACheckpointThatFailsIsSaidAsLongAsItDoes) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    const ScratchFolder folder;
    const auto inside = folder.path() / "disk";
    std::filesystem::create_directory(inside);
    SlamOptions options{.mode = mode, .checkpoint = inside / "map.tfm", .checkpoint_period = 0.1};
    if (mode == RunMode::kThreaded) options.speed = 0.5;
    Slam slam(rig(), options);
    std::filesystem::remove(inside);
    std::size_t next = 0;
    const auto push_until = [&](bool wrong) {
      for (int wait = 0; wait < 1000 && slam.errors().empty() == wrong; ++wait) {
        if (next < kFrames && slam.has_room()) {
          EXPECT_TRUE(slam.push(view(next++)));
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    };
    push_until(true);
    ASSERT_EQ(slam.errors().size(), 1U);
    EXPECT_NE(slam.errors()[0].find("no checkpoint could be written"), std::string::npos) << slam.errors()[0];
    EXPECT_NE(slam.errors()[0].find("map.tfm"), std::string::npos) << slam.errors()[0];
    std::filesystem::create_directory(inside);
    push_until(false);
    EXPECT_TRUE(slam.errors().empty());
    EXPECT_TRUE(slam.finish().errors.empty());
  }
}

TEST_F(SlamModesTest, ATraceIsWrittenInTheEnd) {
  const ScratchFolder folder;
  const auto file = folder.path() / "trace.json";
  Slam slam(rig(), {.trace = file});
  push_all(slam, 0, 10);
  EXPECT_TRUE(slam.finish().errors.empty());
  std::ifstream in(file);
  const std::string trace((std::istreambuf_iterator<char>(in)), {});
  for (const char* thread : {"traceEvents", "\"tracker\"", "\"mapper\"", "\"loop closer\""})
    EXPECT_NE(trace.find(thread), std::string::npos) << thread;

  Slam full(rig(), {.trace = "/dev/full"});
  push_all(full, 0, 10);
  const SlamSummary summary = full.finish();
  ASSERT_EQ(summary.errors.size(), 1U);
  EXPECT_NE(summary.errors[0].find("/dev/full: the trace cannot be written"), std::string::npos);
}

TEST_F(SlamModesTest, ModesThatDoNotGoTogetherAreNamed) {
  const auto expect = [](const SlamOptions& options, const std::string& part) {
    try {
      const Slam slam(rig(), options);
      ADD_FAILURE() << "taken, though " << part;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  expect({.speed = -1}, "options.speed must be finite and >= 0");
  expect({.live = true, .speed = 1}, "options.speed needs RunMode::kThreaded");
  expect({.mode = RunMode::kDeterministic, .speed = 1}, "options.speed needs RunMode::kThreaded");
  expect({.late = LateFrames::kDrop}, "options.late needs");
  expect({.mode = RunMode::kStepped, .checkpoint = "map.tfm"}, "options.checkpoint is not for");
  expect({.checkpoint = "map.tfm", .checkpoint_period = 0}, "options.checkpoint_period must be");
  expect({.checkpoint = "/nowhere/map.tfm"}, "options.checkpoint is in a folder that is not there");
  expect({.trace = "/nowhere/trace.json"}, "options.trace is in a folder that is not there");
}

}  // namespace
}  // namespace twofold
