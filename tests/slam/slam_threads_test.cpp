// Everything at once from four threads of the user's; run by scripts/test tsan, too.
#include <atomic>
#include <filesystem>
#include <thread>

#include <unistd.h>

#include "graph/map_file.hpp"
#include "tests/slam/slam_run.hpp"

namespace twofold {
namespace {

class SlamThreadsTest : public testing::SlamRun {};

TEST_F(SlamThreadsTest, PushPollMapSaveAndStopFromFourThreads) {
  const auto file =
      std::filesystem::temp_directory_path() / ("slam_threads_" + std::to_string(::getpid()) + ".tfm");
  std::atomic<bool> done{false};
  std::atomic<int> told{0}, out_of_order{0}, bad_maps{0}, maps{0}, saves{0};
  Slam slam(rig(), {});
  slam.on_pose([&](const PoseEstimate&) { ++told; });
  std::thread poller([&] {
    std::int64_t last = -1;
    while (!done) {
      if (const auto pose = slam.latest()) {
        out_of_order += pose->frame < last;
        last = pose->frame;
      }
      (void)slam.errors();
      (void)slam.has_room();
    }
  });
  std::thread mapper([&] {
    std::vector<MapSnapshot> held;
    std::uint64_t last = 0;
    while (!done) {
      held.push_back(slam.map());
      bad_maps += held.back().version() < last;
      last = held.back().version();
      for (const auto& point : held.front().points()) bad_maps += point.anchor == kNoId;
      if (held.size() > 4) held.erase(held.begin());
      (void)slam.held_maps();
      ++maps;
    }
  });
  std::thread saver([&] {
    while (!done) {
      if (slam.map().keyframes().empty()) continue;
      slam.save_map(file);
      ++saves;
    }
  });
  std::thread pusher([&] {
    for (std::size_t i = 0; i < kFrames; ++i) {
      while (!slam.wait_for_room(1'000'000'000)) {
      }
      EXPECT_TRUE(slam.push(view(i)));
    }
  });
  pusher.join();
  const SlamSummary summary = slam.finish();
  EXPECT_EQ(slam.push(view(0)).status, PushStatus::kRefused);
  while (maps < 2 || saves < 1) std::this_thread::yield();
  done = true;
  for (std::thread* thread : {&poller, &mapper, &saver}) thread->join();
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_EQ(told, kFrames);
  EXPECT_EQ(out_of_order, 0);
  EXPECT_EQ(bad_maps, 0);
  EXPECT_GT(load_map(file).graph.keyframe_count(), 0U);
  std::filesystem::remove(file);
}

TEST_F(SlamThreadsTest, AnyThreadTakesAnyStepWhileAnotherPushesAndFinishes) {
  std::atomic<bool> done{false};
  Slam slam(rig(), {.mode = RunMode::kStepped});
  const auto take_steps = [&](SlamStep first) {
    while (!done) {
      for (int i = 0; i < 3; ++i) (void)slam.step(static_cast<SlamStep>((static_cast<int>(first) + i) % 3));
    }
  };
  std::vector<std::jthread> threads;
  for (const SlamStep first : {SlamStep::kTrack, SlamStep::kMap, SlamStep::kCloseLoops})
    threads.emplace_back(take_steps, first);
  push_all(slam);
  const SlamSummary summary = slam.finish();  // while the others go on asking for steps
  done = true;
  threads.clear();
  EXPECT_EQ(summary.tracked, kFrames);
  EXPECT_TRUE(summary.errors.empty());
}

TEST_F(SlamThreadsTest, WhoPushesWhileAnotherFinishesIsRefusedAndNoFrameIsLost) {
  Slam slam(rig(), {});
  std::int64_t queued = 0;
  std::thread pusher([&] {
    for (std::size_t i = 0; i < kFrames; ++i) {
      if (!slam.wait_for_room(60'000'000'000)) return;
      const PushResult pushed = slam.push(view(i));
      if (pushed.status == PushStatus::kRefused) return;
      queued += pushed.status == PushStatus::kQueued;
    }
  });
  while (!slam.latest()) std::this_thread::yield();
  const SlamSummary summary = slam.finish();
  pusher.join();
  EXPECT_EQ(summary.tracked, queued);
  EXPECT_EQ(slam.latest()->frame + 1, queued);
}

}  // namespace
}  // namespace twofold
