#include "twofold/slam.hpp"

#include <array>
#include <atomic>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <numeric>
#include <stdexcept>
#include <thread>

#include <unistd.h>

#include "engine/logs/schedule_log.hpp"
#include "engine/pipeline.hpp"
#include "graph/graph_writer.hpp"
#include "io/files/trajectory_file.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "slam/slam_options.hpp"
#include "slam/summary.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/io/small_files.hpp"
#include "tests/slam/slam_run.hpp"
#include "twofold/evaluation.hpp"

namespace twofold {
namespace {

using testing::run_engine;

/// Shut, it holds whoever comes by.
class Gate {
 public:
  void pass() {
    std::unique_lock lock(lock_);
    open_.wait(lock, [&] { return is_open_; });
  }
  void open() {
    const std::scoped_lock lock(lock_);
    is_open_ = true;
    open_.notify_all();
  }

 private:
  std::mutex lock_;
  std::condition_variable open_;
  bool is_open_ = false;
};

/// The pipeline's threads end whatever the test finds.
struct OpenAtLast {
  Gate& gate;
  ~OpenAtLast() { gate.open(); }
};

class SlamTest : public testing::SlamRun {};

TEST_F(SlamTest, DeterministicRunsGiveTheEnginesBytes) {
  EngineOptions options;
  options.deterministic = true;
  options.vocabulary = std::make_shared<const Vocabulary>(load_default_vocabulary());
  const RunResult expected = run_engine(options, feed());
  std::vector<PoseEstimate> poses;
  Slam slam(rig(), deterministic());
  slam.on_pose([&](const PoseEstimate& pose) { poses.push_back(pose); });
  push_all(slam);
  const SlamSummary summary = slam.finish();
  ASSERT_EQ(poses.size(), expected.frames.size());
  ASSERT_EQ(summary.poses.size(), expected.frames.size());
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const FrameRecord& record = expected.frames[i];
    EXPECT_EQ(poses[i].T_world_camera, to_pose(record.T_c_w_causal.unpacked().inverse())) << i;
    EXPECT_EQ(poses[i].map_version, record.snapshot_version);
    EXPECT_EQ(poses[i].points, record.inliers);
    EXPECT_EQ(summary.poses[i].T_world_camera, to_pose(final_T_c_w(record, expected.graph).inverse()));
  }
  EXPECT_EQ(summary.frames, kFrames);
  EXPECT_EQ(summary.tracked, kFrames);
}

TEST_F(SlamTest, TellsWhatTheTrackerDidForAFrame) {
  Slam slam(rig(), deterministic());
  std::vector<std::int64_t> numbers;
  std::array<MeasuredPoint, 64> points;
  std::size_t most = 0;
  double error = 0, told = 0, spent = 0;
  slam.on_frame([&](const PoseEstimate& pose, const FrameDetails& details) {
    numbers.push_back(pose.frame);
    ASSERT_EQ(details.stage_ns().size(), tracker_stages().size());
    spent += static_cast<double>(
        std::accumulate(details.stage_ns().begin(), details.stage_ns().end(), std::int64_t{0}));
    EXPECT_EQ(details.waiting().frames, 0);
    const std::size_t count = details.points(points);
    std::vector<MeasuredPoint> all(5000);
    EXPECT_EQ(count, std::min(points.size(), details.points(all)));
    most = std::max(most, count);
    for (const MeasuredPoint& point : std::span(points).first(count)) {
      if (point.inlier == 0) continue;
      error += std::hypot(point.u - point.expected_u, point.v - point.expected_v);
      ++told;
      EXPECT_GT(point.radius, 0);
    }
  });
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(slam.push(view(static_cast<std::size_t>(i))).frame, i) << "as its pose is numbered";
  EXPECT_EQ(slam.push(view(2)).frame, -1) << "refused";
  (void)slam.finish();
  EXPECT_EQ(numbers, (std::vector<std::int64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(most, points.size()) << "as far as there is room";
  EXPECT_LT(error / told, 1.5) << "found where the pose puts them [px]";
  EXPECT_GT(spent, 0);
}

TEST_F(SlamTest, ThreadedRunsFollowTheCamera) {
  std::vector<PoseEstimate> poses;
  Slam slam(rig(), {});
  slam.on_pose([&](const PoseEstimate& pose) { poses.push_back(pose); });
  push_all(slam);
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_TRUE(summary.errors.empty());
  ASSERT_EQ(poses.size(), static_cast<std::size_t>(kFrames));
  const SE3 T_world_first = to_se3(poses[0].T_world_camera);
  for (int i = 0; i < kFrames; ++i) {
    const auto& pose = poses[static_cast<std::size_t>(i)];
    const SE3 T_first_now = T_world_first.inverse() * to_se3(pose.T_world_camera);
    const SE3 truth = T_c_w(0) * T_c_w(i).inverse();
    EXPECT_LT((T_first_now.translation() - truth.translation()).norm(), 0.02) << i;
    EXPECT_EQ(pose.covariance[0] > 0, i > 0) << "the first frame is where the world is";
    EXPECT_LT(pose.covariance[0], 1e-3) << i;
  }
  // A frame takes 1/30 s.
  const Vector6 velocity = 30 * (T_c_w(19) * T_c_w(20).inverse()).log();
  for (int k = 0; k < 6; ++k)
    EXPECT_NEAR(poses[20].velocity[static_cast<std::size_t>(k)], velocity[k], 0.1) << k;
}

TEST_F(SlamTest, FramesThatCannotBeUsedAreRefusedAndNothingIsLost) {
  Slam slam(rig(), deterministic());
  push_all(slam, 0, 10);
  FrameView backwards = view(5);
  EXPECT_EQ(slam.push(backwards).status, PushStatus::kRefused);
  FrameView small = view(10);
  small.left.width /= 2;
  const PushResult refused = slam.push(small);
  EXPECT_EQ(refused.status, PushStatus::kRefused);
  EXPECT_NE(refused.reason.find("160x240"), std::string::npos) << refused.reason;
  push_all(slam, 10);
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(summary.frames, kFrames);
  EXPECT_EQ(summary.tracked, kFrames);
}

/// The trajectory of a run whose records went to disk is that of one in memory, and its files tell the same.
TEST_F(SlamTest, ARunFolderTakesTheTrajectoryAndTheSchedule) {
  const ScratchFolder folder;
  SlamOptions on_disk = deterministic();
  on_disk.run_folder = folder.path();
  Slam slam(rig(), on_disk), in_memory(rig(), deterministic());
  push_all(slam);
  push_all(in_memory);
  const SlamSummary summary = slam.finish(), expected = in_memory.finish();
  EXPECT_TRUE(summary.errors.empty());
  ASSERT_EQ(summary.poses.size(), expected.poses.size());
  for (std::size_t i = 0; i < summary.poses.size(); ++i)
    EXPECT_EQ(summary.poses[i].T_world_camera, expected.poses[i].T_world_camera) << i;
  EXPECT_EQ(load_trajectory(folder.path() / "trajectory_causal.txt").size(),
            static_cast<std::size_t>(kFrames));
  std::ifstream file(folder / "schedule.log", std::ios::binary);
  const auto schedule = read_schedule(file);
  ASSERT_TRUE(schedule) << schedule.error();
  EXPECT_TRUE(schedule->ended);
  EXPECT_EQ(schedule->tracker.size(), static_cast<std::size_t>(kFrames));
}

TEST_F(SlamTest, ARunOfTheLibraryIsReplayedByTheLibrary) {
  const ScratchFolder folder;
  const auto poses_of = [](const SlamSummary& summary) {
    std::vector<Pose> poses;
    for (const auto& pose : summary.poses) poses.push_back(pose.T_world_camera);
    return poses;
  };
  Slam threaded(rig(), {.run_folder = folder.path()});
  push_all(threaded);
  const SlamSummary expected = threaded.finish();
  const SlamOptions replay{.mode = RunMode::kReplay, .schedule = folder.path() / "schedule.log"};
  Slam again(rig(), replay);
  push_all(again);
  EXPECT_FALSE(again.has_room());
  const PushResult beyond = again.push(view(0));
  EXPECT_EQ(beyond.status, PushStatus::kRefused);
  EXPECT_EQ(beyond.reason, "the schedule has no more frames");
  const SlamSummary summary = again.finish();
  EXPECT_TRUE(summary.errors.empty());
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_EQ(poses_of(summary), poses_of(expected));

  // Frames of another run: the schedule has a keyframe that nobody proposes.
  Slam other(rig(), replay);
  for (std::size_t i = 0; i < kFrames && other.has_room(); ++i) {
    FrameView dark = view(0);
    dark.t_ns = view(i).t_ns;
    if (i > 0) dark.right = dark.left;  // nothing has depth
    (void)other.push(dark);
  }
  EXPECT_FALSE(other.errors().empty());
  const SlamSummary failed = other.finish();
  ASSERT_EQ(failed.errors.size(), 1U);
  EXPECT_NE(failed.errors.front().find("schedule"), std::string::npos) << failed.errors.front();
}

TEST_F(SlamTest, AReplayIsOfTheSameInputAndKeepsItsSchedule) {
  const ScratchFolder folder;
  const auto schedule = folder.path() / "schedule.log";
  Slam recorded(rig(), {.mode = RunMode::kDeterministic, .run_folder = folder.path()});
  push_all(recorded);
  (void)recorded.finish();
  EXPECT_THROW(Slam(rig(), {.mode = RunMode::kReplay, .schedule = schedule, .run_folder = folder.path()}),
               std::invalid_argument);
  const auto error_of_replay = [&](const CameraRig& its_rig, std::size_t first) {
    Slam replay(its_rig, {.mode = RunMode::kReplay, .schedule = schedule});
    (void)replay.push(view(first));
    const SlamSummary summary = replay.finish();
    return summary.errors.empty() ? "" : summary.errors.front();
  };
  EXPECT_EQ(error_of_replay(rig(), 0), "");
  EXPECT_NE(error_of_replay(rig(), 1).find("another recording"), std::string::npos);
  CameraRig other = rig();
  other.baseline *= 1.001;
  EXPECT_NE(error_of_replay(other, 0).find("another rig"), std::string::npos);
}

TEST_F(SlamTest, ARigLargerThanAnyCameraIsRefused) {
  CameraRig large = rig();
  large.width = large.height = 100'000;
  EXPECT_THROW(Slam(large, {}), std::invalid_argument);
}

TEST_F(SlamTest, AProgramDrivesTheStepsItself) {
  Slam slam(rig(), {.mode = RunMode::kStepped, .frame_buffers = 3});
  std::thread::id told_by;
  int told = 0;
  slam.on_pose([&](const PoseEstimate&) {
    told_by = std::this_thread::get_id();
    EXPECT_THROW((void)slam.step(SlamStep::kMap), std::logic_error);
    ++told;
  });
  EXPECT_FALSE(slam.step(SlamStep::kTrack));
  std::size_t pushed = 0;
  for (; pushed < 3; ++pushed) ASSERT_TRUE(slam.push(view(pushed)));
  EXPECT_EQ(slam.push(view(pushed++)).status, PushStatus::kDropped) << "nobody has taken a step";
  EXPECT_EQ(told, 0);
  while (slam.step(SlamStep::kTrack)) {
  }
  EXPECT_EQ(told, 3);
  EXPECT_EQ(told_by, std::this_thread::get_id());
  EXPECT_TRUE(slam.map().keyframes().empty()) << "nobody has taken a step of the map";
  EXPECT_TRUE(slam.step(SlamStep::kMap));
  EXPECT_FALSE(slam.map().keyframes().empty());
  EXPECT_FALSE(slam.step(SlamStep::kMap)) << "all that was proposed is in the map";
  EXPECT_TRUE(slam.step(SlamStep::kCloseLoops));
  for (; pushed < kFrames; ++pushed) {
    ASSERT_TRUE(slam.push(view(pushed)));
    while (slam.step(SlamStep::kTrack) || slam.step(SlamStep::kMap) || slam.step(SlamStep::kCloseLoops)) {
    }
  }
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(summary.tracked, kFrames - 1);
  EXPECT_EQ(summary.dropped, 1);
  EXPECT_FALSE(slam.step(SlamStep::kTrack));
  Slam threaded(rig(), {});
  EXPECT_THROW((void)threaded.step(SlamStep::kTrack), std::logic_error);
}

TEST_F(SlamTest, AfterTheEndAnswersAreKept) {
  Slam slam(rig(), deterministic());
  push_all(slam, 0, 20);
  const SlamSummary first = slam.finish();
  const PushResult late = slam.push(view(20));
  EXPECT_EQ(late.status, PushStatus::kRefused);
  EXPECT_NE(late.reason.find("finish"), std::string::npos) << late.reason;
  EXPECT_FALSE(slam.wait_for_room(0));
  EXPECT_FALSE(slam.has_room());
  EXPECT_THROW(slam.on_pose({}), std::logic_error);
  EXPECT_EQ(slam.finish().frames, first.frames);
  EXPECT_EQ(slam.latest()->frame, 19);
  EXPECT_FALSE(slam.map().keyframes().empty());
}

TEST_F(SlamTest, ACallbackThatThrowsIsReportedAndTrackingGoesOn) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    int calls = 0;
    Slam slam(rig(), {.mode = mode});
    slam.on_pose([&](const PoseEstimate& pose) {
      ++calls;
      if (pose.frame == 5) throw std::runtime_error("no room on the table");
    });
    push_all(slam);
    const SlamSummary summary = slam.finish();
    EXPECT_EQ(calls, 6);
    EXPECT_EQ(summary.tracked, kFrames);
    ASSERT_EQ(summary.errors.size(), 1U);
    EXPECT_NE(summary.errors[0].find("on_pose"), std::string::npos);
    EXPECT_NE(summary.errors[0].find("no room on the table"), std::string::npos);
    EXPECT_EQ(slam.errors(), summary.errors);
    EXPECT_EQ(slam.latest()->frame, kFrames - 1);
  }
}

TEST_F(SlamTest, ACallbackThatWouldWaitForItselfIsTold) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    Slam slam(rig(), {.mode = mode});
    slam.on_pose([&](const PoseEstimate&) { (void)slam.finish(); });
    slam.on_frame([&](const PoseEstimate&, const FrameDetails&) { (void)slam.push(view(3)); });
    push_all(slam);
    const SlamSummary summary = slam.finish();
    EXPECT_EQ(summary.tracked, kFrames);
    ASSERT_EQ(summary.errors.size(), 2U);
    EXPECT_NE(summary.errors[0].find("finish was called from a callback"), std::string::npos);
    EXPECT_NE(summary.errors[1].find("push was called from a callback"), std::string::npos);
  }
}

TEST_F(SlamTest, AMapIsSavedNeitherByACallbackNorBeforeThereIsOne) {
  const ScratchFolder folder;
  Slam slam(rig(), deterministic());
  try {
    slam.save_map(folder.path() / "map.tfm");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("map.tfm: there is no map yet"), std::string::npos);
  }
  slam.on_pose([&](const PoseEstimate&) { slam.save_map(folder.path() / "map.tfm"); });
  push_all(slam, 0, 3);
  ASSERT_EQ(slam.errors().size(), 1U);
  EXPECT_NE(slam.errors()[0].find("save_map was called from a callback"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "map.tfm"));
  slam.save_map(folder.path() / "map.tfm");
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "map.tfm"));
}

TEST_F(SlamTest, AMapperThatIsBehindTakesNoPushAway) {
  Gate gate;
  EngineOptions options = engine_options({.frame_buffers = 2 * kFrames});
  int steps = 0;  // mapper's
  std::atomic<bool> stands{false};
  options.before_step = [&](std::string_view thread) {
    if (thread != "mapper" || ++steps == 1) return;
    stands = true;
    gate.pass();
  };
  std::atomic<int> told{0}, versions{0};
  options.on_map = [&](const GraphSnapshot&, const DoubleWindow&) { ++versions; };
  options.on_pose = [&](const PoseReport&) { ++told; };
  const auto pipeline = make_pipeline(testing::small_rig(), options);
  const OpenAtLast open_at_last{gate};
  const int first_version = versions;
  // Until two keyframes wait for the mapper, which stands still after the first; each frame is tracked before
  // the next one.
  int pushed = 0;
  while (pipeline->waiting().keyframes < 2 && pushed < kFrames) {
    ASSERT_TRUE(pipeline->has_buffer());
    pipeline->push((*frames_)[static_cast<std::size_t>(pushed++)]);
    while (told < pushed || versions == first_version || (pipeline->waiting().keyframes > 0 && !stands))
      std::this_thread::yield();
  }
  ASSERT_GE(pipeline->waiting().keyframes, 2U);
  EXPECT_FALSE(pipeline->has_room()) << "who reads a recording waits for the map";
  EXPECT_TRUE(pipeline->has_buffer());
  const int blocked_at = pushed;
  for (; pushed < kFrames; ++pushed) {
    ASSERT_TRUE(pipeline->has_buffer())
        << "the mapper's step stands still, and frame " << pushed << " has none";
    pipeline->push((*frames_)[static_cast<std::size_t>(pushed)]);
  }
  EXPECT_GT(pushed, blocked_at);
  EXPECT_FALSE(pipeline->has_room());
  gate.open();
  pipeline->stop();
  const RunResult result = pipeline->finish();
  EXPECT_EQ(result.counts.frames, kFrames);
  EXPECT_EQ(result.counts.dropped, 0);
}

TEST_F(SlamTest, TheRunsFolderIsWholeThoughNoFrameComes) {
  const auto folder = std::filesystem::temp_directory_path() / ("slam_quiet_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  Slam slam(rig(), {.run_folder = folder});
  constexpr std::size_t kPushed = 5;
  push_all(slam, 0, kPushed);
  std::size_t poses = 0;
  for (int wait = 0; wait < 500 && poses < kPushed; ++wait) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::ifstream in(folder / "trajectory_causal.txt");
    poses = 0;
    for (std::string line; std::getline(in, line);) poses += !line.starts_with('#');
  }
  EXPECT_EQ(poses, kPushed) << "without another push";
  (void)slam.finish();
  std::filesystem::remove_all(folder);
}

TEST_F(SlamTest, ADiskThatIsFullIsSaidWhileItRunsAndNothingIsLostWhenThereIsRoomAgain) {
  const ScratchFolder folder;
  Slam slam(rig(), {.run_folder = folder.path()});
  const auto names = [](const std::vector<std::string>& all, const char* file) {
    return std::any_of(all.begin(), all.end(), [&](const std::string& error) {
      return error.find(file) != std::string::npos &&
             error.find("wait for room on the disk") != std::string::npos;
    });
  };
  std::vector<std::string> errors;
  {
    const testing::SmallFiles small(300);
    push_all(slam, 0, 10);
    for (int wait = 0; wait < 500 && errors.size() < 2; ++wait) {  // without another push
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      errors = slam.errors();
    }
  }
  EXPECT_TRUE(names(errors, "trajectory_causal.txt"));
  EXPECT_TRUE(names(errors, "(records of frames)"));
  EXPECT_TRUE(slam.push(view(10))) << "tracking goes on";
  for (int wait = 0; wait < 500 && !slam.errors().empty(); ++wait)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_TRUE(slam.errors().empty()) << slam.errors()[0];
  const SlamSummary summary = slam.finish();
  EXPECT_TRUE(summary.errors.empty());
  EXPECT_EQ(summary.poses.size(), 11U);
  EXPECT_EQ(read_tum_trajectory(folder.path() / "trajectory_causal.txt").size(), 11U);
}

/// Each file that lost something is a sentence of its own, during the run and after it.
TEST_F(SlamTest, WhatEachFileLostIsSaidInASentenceOfItsOwn) {
  const ScratchFolder folder;
  Slam slam(rig(), {.run_folder = folder.path()});
  const testing::SmallFiles small(300);
  push_all(slam, 0, 10);
  const SlamSummary summary = slam.finish();
  ASSERT_EQ(summary.errors.size(), 2U);
  EXPECT_NE(summary.errors[0].find("(records of frames): File too large; 9 records of frames are missing"),
            std::string::npos)
      << summary.errors[0];
  EXPECT_NE(summary.errors[1].find(" poses are missing, from "), std::string::npos) << summary.errors[1];
  EXPECT_EQ(slam.errors(), summary.errors);
}

TEST(SlamSummary, SaysWhatWasMeasuredOfTheCamera) {
  RunResult result;
  EXPECT_EQ(summarise(result).row_offset, 0);
  EXPECT_FALSE(summarise(result).readout);
  result.row_offset = -1.5;
  result.readout = ReadoutEstimate{.seconds = 0.02, .sigma = 0.001, .pairs = 12, .significant = true};
  const SlamSummary summary = summarise(result);
  EXPECT_EQ(summary.row_offset, -1.5);
  ASSERT_TRUE(summary.readout);
  EXPECT_TRUE(summary.readout->found);
  EXPECT_EQ(summary.readout->seconds, 0.02);
  EXPECT_EQ(summary.readout->sigma, 0.001);
  EXPECT_EQ(summary.readout->pairs, 12);
}

TEST(SlamSummary, LeavesOutFramesWhoseKeyframeWasCulledAndForgotten) {
  GraphWriter writer;
  Keyframe first, culled;
  first.id = KeyframeId{0};
  culled.id = KeyframeId{1};
  writer.add_keyframe(std::move(first));
  writer.add_keyframe(std::move(culled));
  writer.set_reference(KeyframeId{0});
  writer.cull_keyframe(KeyframeId{1}, KeyframeId{0});
  writer.forget_replacements(0);
  RunResult result;
  result.graph = writer.publish();
  for (const std::uint32_t reference : {0U, 1U, 2U}) {  // of the last one the mapper never heard
    FrameRecord record;
    record.t_ns = reference;
    record.state = FrameState::kTracked;
    record.reference = KeyframeId{reference};
    result.frames.push_back(record);
  }
  const SlamSummary summary = summarise(result);
  ASSERT_EQ(summary.poses.size(), 1U);
  EXPECT_EQ(summary.poses[0].t_ns, 0);
}

TEST_F(SlamTest, ASlowCallbackIsAStageOfItsOwn) {
  Slam slam(rig(), {});
  slam.on_pose([](const PoseEstimate&) { std::this_thread::sleep_for(std::chrono::milliseconds(3)); });
  push_all(slam, 0, 20);
  for (const StageTime& time : slam.finish().timings) {
    if (time.stage != "pose listener") continue;
    EXPECT_EQ(time.thread, "tracker");
    EXPECT_EQ(time.count, 20U);
    EXPECT_GE(time.p50_ms, 3);
    return;
  }
  FAIL() << "no such stage";
}

TEST_F(SlamTest, CallbacksAreSetBeforeTheFirstPush) {
  Slam slam(rig(), deterministic());
  slam.on_pose([](const PoseEstimate&) {});
  push_all(slam, 0, 1);
  EXPECT_THROW(slam.on_pose({}), std::logic_error);
  EXPECT_THROW(slam.on_event({}), std::logic_error);
}

TEST_F(SlamTest, ACallbackSetsNoCallback) {
  for (const RunMode mode : {RunMode::kThreaded, RunMode::kDeterministic}) {
    Slam slam(rig(), {.mode = mode});
    slam.on_pose([&](const PoseEstimate&) { slam.on_event({}); });
    push_all(slam, 0, 3);
    const SlamSummary summary = slam.finish();
    ASSERT_EQ(summary.errors.size(), 1U);
    EXPECT_NE(summary.errors[0].find("on_event was called from a callback"), std::string::npos);
  }
}

TEST_F(SlamTest, AFrameWithoutRoomIsDroppedAndPushDoesNotWait) {
  std::atomic<bool> may_go_on{false};
  SlamOptions options;
  options.frame_buffers = 3;
  Slam slam(rig(), options);
  slam.on_pose([&](const PoseEstimate&) { may_go_on.wait(false); });  // holds the tracker, as none should
  std::size_t queued = 0;
  PushResult pushed;
  while ((pushed = slam.push(view(queued)))) ++queued;
  EXPECT_EQ(queued, 3U);
  EXPECT_EQ(pushed.status, PushStatus::kDropped);
  EXPECT_NE(pushed.reason.find("tracker is behind"), std::string::npos) << pushed.reason;
  EXPECT_FALSE(slam.wait_for_room(1'000'000));
  may_go_on = true;
  may_go_on.notify_all();
  ASSERT_TRUE(slam.wait_for_room(60'000'000'000));
  EXPECT_TRUE(slam.push(view(queued + 1)));
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(summary.frames, 5);
  EXPECT_EQ(summary.dropped, 1);
  EXPECT_EQ(slam.latest()->frame, 4) << "numbers count dropped frames";
}

TEST_F(SlamTest, LiveFramesMustBearTheTimeOfTheClock) {
  Slam slam(rig(), {.live = true});
  const PushResult pushed = slam.push(view(0));
  EXPECT_EQ(pushed.status, PushStatus::kRefused);
  EXPECT_NE(pushed.reason.find("CLOCK_MONOTONIC"), std::string::npos) << pushed.reason;
  FrameView now = view(0);
  now.t_ns = steady_now_ns();
  EXPECT_TRUE(slam.push(now));
  (void)slam.finish();
  EXPECT_EQ(slam.latest()->exposed_ns, now.t_ns);
  EXPECT_GT(slam.latest()->latency_ns, 0);
}

std::string what_is_wrong(const CameraRig& rig, const SlamOptions& options) {
  try {
    const Slam slam(rig, options);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing";
}

TEST_F(SlamTest, OptionsAndRigsThatMakeNoSenseAreNamed) {
  const auto expect = [](const std::string& what, const std::string& part) {
    EXPECT_NE(what.find(part), std::string::npos) << what;
  };
  CameraRig rig_without_baseline = rig();
  rig_without_baseline.baseline = 0;
  expect(what_is_wrong(rig_without_baseline, {}), "rig.baseline must be in (0, 20], is 0");
  rig_without_baseline.baseline = 110;  // millimetres
  expect(what_is_wrong(rig_without_baseline, {}), "rig.baseline must be in (0, 20], is 110");
  CameraRig rig_without_focus = rig();
  rig_without_focus.fx = std::numeric_limits<double>::quiet_NaN();
  expect(what_is_wrong(rig_without_focus, {}), "rig.fx");
  CameraRig rig_before_time = rig();
  rig_before_time.readout = -0.01;
  expect(what_is_wrong(rig_before_time, {}), "rig.readout must be 0 to 0.5, is -0.01");
  rig_before_time.readout = 23.7;  // milliseconds
  expect(what_is_wrong(rig_before_time, {}), "rig.readout must be 0 to 0.5, is 23.7");
  rig_before_time.readout = std::numeric_limits<double>::infinity();
  expect(what_is_wrong(rig_before_time, {}), "rig.readout must be 0 to 0.5, is inf");
  CameraRig rgbd = rig();
  rgbd.sensor = Sensor::kRgbd;
  rgbd.depth_max = 0.1;
  expect(what_is_wrong(rgbd, {}), "rig.depth_max");
  rgbd = rig();
  rgbd.sensor = Sensor::kRgbd;
  rgbd.baseline = 0;  // need not be said
  EXPECT_EQ(what_is_wrong(rgbd, {}), "nothing");
  rgbd.depth_max = std::numeric_limits<double>::infinity();
  expect(what_is_wrong(rgbd, {}), "rig.depth_max must be finite");
  expect(what_is_wrong(rig(), {.localise_only = true}), "options.localise_only needs options.map");
  expect(what_is_wrong(rig(), {.inner_window = 0}), "options.inner_window");
  expect(what_is_wrong(rig(), {.outer_window = -1}), "options.outer_window");
  expect(what_is_wrong(rig(), {.frame_buffers = 1}), "options.frame_buffers");
  expect(what_is_wrong(rig(), {.frame_buffers = 1'000'000'000}), "options.frame_buffers");
  expect(what_is_wrong(rig(), {.tracker_cpu = -1}), "options.tracker_cpu");
  expect(what_is_wrong(rig(), {.mapper_cpu = -1}), "options.mapper_cpu");
  expect(what_is_wrong(rig(), {.loop_closer_cpu = -1}), "options.loop_closer_cpu");
  expect(what_is_wrong(rig(), {.fifo_priority = 100}), "options.fifo_priority");
  expect(what_is_wrong(rig(), {.run_folder = "/nowhere/at.all"}),
         "options.run_folder must be a folder that is there, is /nowhere/at.all");
  expect(what_is_wrong(rig(), {.kept_frames = 0}), "options.kept_frames");
  EXPECT_EQ(SlamOptions().invalid_reason(), "");
  EXPECT_EQ(SlamOptions{.kept_frames = 0}.invalid_reason(), "kept_frames must be >= 1, is 0");
  expect(what_is_wrong(rig(), {.mode = RunMode::kDeterministic, .live = true}), "options.live");
  EXPECT_THROW(Slam(rig(), {.map = "/nowhere/at.all"}), std::runtime_error);
}

}  // namespace
}  // namespace twofold
