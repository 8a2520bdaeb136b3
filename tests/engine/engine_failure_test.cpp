// Threads that fail in the middle of a run: it ends at once, keeps what it has and says which one and why.
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <new>
#include <stdexcept>
#include <thread>

#include "engine/checkpoint_writer.hpp"
#include "engine/threaded_run.hpp"
#include "graph/graph_writer.hpp"
#include "tests/engine/kidnapped_camera.hpp"

namespace twofold {
namespace {

using testing::number_frame;
using testing::small_rig;

class EngineFailureTest : public testing::KidnappedCamera {
 protected:
  static constexpr int kManyFrames = 100'000;  // at 30 a second, nearly an hour

  static EngineOptions threaded() {
    EngineOptions threaded = options();
    threaded.deterministic = false;
    return threaded;
  }
  /// There and back again, slowly enough for the threads to take turns.
  static const Frame& walk(int i) {
    const int n = i % (2 * kFrames - 2);
    return (*mapped_)[static_cast<std::size_t>(n < kFrames ? n : 2 * kFrames - 2 - n)];
  }
  static FrameFeed endless_walk() {
    return [next = 0](Frame& frame) mutable {
      if (next == kManyFrames) return FrameStatus::kEnd;
      frame = walk(next);
      number_frame(frame, next++);
      return FrameStatus::kFrame;
    };
  }
};

TEST_F(EngineFailureTest, AThreadThatFailsEndsTheRunAtOnceAndIsNamed) {
  const auto file = std::filesystem::temp_directory_path() /
                    ("twofold_engine_failure_test_" + std::to_string(::getpid()) + ".tfm");
  for (const std::string failing : {"tracker", "mapper", "loop closer", "checkpoints"}) {
    EngineOptions options = threaded();
    options.checkpoint = {file, 0.01};
    std::atomic<int> steps{0};
    options.before_step = [&](std::string_view thread) {
      if (thread == failing && ++steps == 2) throw std::runtime_error("out of order");
    };
    const RunResult result = testing::run_engine(options, endless_walk());
    EXPECT_EQ(result.error, failing + ": out of order");
    EXPECT_EQ(steps, 2);
    EXPECT_LT(result.frames.size(), std::size_t{kManyFrames});
    EXPECT_GE(result.frames.size(), 1U);
    EXPECT_GE(result.graph.keyframe_count(), 1U);
  }
  std::filesystem::remove(file);
}

TEST_F(EngineFailureTest, ALostCameraIsAnsweredWhenTheLoopCloserFails) {
  EngineOptions options = threaded();
  std::atomic<bool> lost{false};
  options.on_pose = [&](const PoseReport& report) {
    const FrameRecord& record = report.record;
    lost = record.frame_index >= kFrames && record.state == FrameState::kLost;
  };
  options.before_step = [&](std::string_view thread) {
    if (thread == "loop closer" && lost) throw std::runtime_error("out of order");
  };
  ThreadedRun run(small_rig(), options);
  const FrameFeed frames = kidnapped(false, 1000);
  int after_failure = 0;
  for (Frame frame; after_failure < 20 && frames(frame) == FrameStatus::kFrame;) {
    while (!run.has_room()) {
      run.collect({});
      run.wait(std::chrono::steady_clock::now() + std::chrono::milliseconds(5));
    }
    run.push(std::move(frame));
    after_failure += run.failed();
    if (lost) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_EQ(after_failure, 20);
  run.stop();
  run.collect({});
  const RunResult result = run.finish();
  EXPECT_EQ(result.error, "loop closer: out of order");
  std::uint32_t answers = 0;
  for (const TrackerStep& step : testing::schedule_of(result).tracker) answers += step.messages;
  EXPECT_GE(answers, 1U);
}

TEST(CheckpointWriter, ReportsWhateverASaveThrowsAndTriesAgain) {
  int saves = 0;
  CheckpointWriter writer(small_rig(), {"map.tfm", 1}, [&](const auto&...) {
    if (++saves == 1) throw std::bad_alloc();
    if (saves == 2) throw 7;
  });
  GraphSnapshot graph = GraphWriter().publish();
  writer.save(graph, {});
  EXPECT_EQ(writer.report().error, std::bad_alloc().what());
  writer.save(graph, {});
  EXPECT_EQ(writer.report().error, "an exception of unknown type");
  EXPECT_EQ(writer.report().saved, 0);
  writer.save(graph, {});
  EXPECT_EQ(saves, 3);
  EXPECT_EQ(writer.report().saved, 1);
}

}  // namespace
}  // namespace twofold
