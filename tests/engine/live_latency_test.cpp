// Cameras in real time: when a frame's pose is known after its exposure, and whether the run says so.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "engine/engine.hpp"
#include "fixtures/punctual_camera.hpp"
#include "fixtures/side_by_side_camera.hpp"
#include "io/sources/synthetic_source.hpp"
#include "io/sources/v4l2_source.hpp"
#include "tests/sanitized.hpp"

namespace twofold {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kGap = 500 * kMs;
constexpr std::size_t kFrames = 60;

/// One pose as it was heard of outside of the engine.
struct Heard {
  std::int64_t frame = 0;
  std::int64_t said_ns = 0;   ///< latency in the record
  std::int64_t truth_ns = 0;  ///< from the frame's time stamp to this moment
};

class LiveLatencyTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const auto source = open_synthetic(
        "desk", {{"width", "320"}, {"height", "240"}, {"fps", "30"}, {"frames", std::to_string(kFrames)}});
    rig_ = source->rig();
    images_.clear();
    for (Frame frame; images_.size() < kFrames && source->next(frame) == FrameStatus::kFrame;) {
      const cv::Mat both = testing::side_by_side(frame);
      images_.emplace_back(both.data, both.data + both.total());
    }
    ASSERT_EQ(images_.size(), kFrames) << source->error();
  }

  LiveLatencyTest() {
    auto driver = std::make_unique<PunctualCamera>();
    driver_ = driver.get();
    FakeV4l2::Device& device = driver_->device();
    testing::set_up_side_by_side(device, rig_, V4L2_PIX_FMT_GREY);
    device.fps = testing::kSanitized ? 5 : 30;
    device.frame = [](std::uint64_t k) {
      FakeFrame frame;
      frame.bytes = images_.at(std::min<std::size_t>(k, kFrames - 1));
      return frame;
    };
    opened_with_ = std::move(driver);
    options_.pacing = {.late = LatePolicy::kNewest, .live = true};
    options_.on_pose = [this](const PoseReport& report) {
      const FrameRecord& record = report.record;
      heard_.push_back({record.frame_index, record.latency_ns, driver_->now_ns() - record.t_ns});
      newest_heard_.store(record.frame_index, std::memory_order_relaxed);
      if (pause_tracker_at_ == record.frame_index)
        std::this_thread::sleep_for(std::chrono::nanoseconds(kGap));
    };
  }

  /// Captures and tracks until frame kFrames - 1.
  RunResult run() {
    source_ = std::make_unique<V4l2Source>(parse_source_spec(testing::side_by_side_source(rig_)),
                                           SourceOptions{}, std::move(opened_with_));
    const FrameFeed feed = [this](Frame& frame) {
      if (frame_ + 1 >= static_cast<std::int64_t>(kFrames)) return FrameStatus::kEnd;
      if (source_->next(frame) != FrameStatus::kFrame) return FrameStatus::kError;
      frame_ = frame.index;
      return FrameStatus::kFrame;
    };
    std::atomic<bool> interrupted{false};
    RunResult result = Engine(rig_, options_).run(feed, interrupted);
    EXPECT_EQ(result.error, "") << source_->error();
    return result;
  }

  template <class Value>
  static std::int64_t median(const std::vector<Heard>& heard, const Value& value) {
    std::vector<std::int64_t> values;
    for (const Heard& one : heard) values.push_back(value(one));
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }
  /// The reported latencies are the true ones, and half of them at least are far below the gap.
  static void expect_true_and_short(const std::vector<Heard>& heard) {
    ASSERT_GT(heard.size(), kFrames / 3);
    for (const Heard& one : heard) EXPECT_LE(one.said_ns, one.truth_ns) << one.frame;
    EXPECT_LT(median(heard, [](const Heard& one) { return one.truth_ns - one.said_ns; }), 5 * kMs);
    EXPECT_LT(median(heard, [](const Heard& one) { return one.truth_ns; }), kGap / 2);
  }

  static inline Rig rig_;
  static inline std::vector<std::vector<std::uint8_t>> images_;
  PunctualCamera* driver_ = nullptr;  // of opened_with_, then of source_
  std::unique_ptr<V4l2Calls> opened_with_;
  std::unique_ptr<V4l2Source> source_;
  EngineOptions options_;
  std::int64_t frame_ = -1;
  std::vector<Heard> heard_;  // on the tracker's thread, until that has ended
  std::atomic<std::int64_t> newest_heard_{-1};
  std::int64_t pause_tracker_at_ = -1;
};

TEST_F(LiveLatencyTest, NoFrameIsHeldBackForItsSuccessor) {
  // No frame is exposed before the pose of the one before it is known.
  const auto patience_ends = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  driver_->may_expose = [&](std::uint64_t k) {
    return newest_heard_.load(std::memory_order_relaxed) + 1 >= static_cast<std::int64_t>(k) ||
           std::chrono::steady_clock::now() > patience_ends;
  };
  const RunResult result = run();
  EXPECT_LT(std::chrono::steady_clock::now(), patience_ends);
  ASSERT_EQ(heard_.size(), kFrames);
  EXPECT_EQ(result.frames.size(), kFrames);
}

TEST_F(LiveLatencyTest, AGapAtTheStartIsNoPartOfTheLatency) {
  driver_->pauses = {{1, kGap}};
  const RunResult result = run();
  expect_true_and_short(heard_);
  EXPECT_LT(source_->report().lost, kFrames / 4);
  EXPECT_EQ(exposure_to_pose(result).count(), heard_.size());
}

TEST_F(LiveLatencyTest, ACameraThatPausesComesBackWithoutDelay) {
  driver_->pauses = {{kFrames / 2, kGap}};
  (void)run();
  const auto after = std::find_if(heard_.begin(), heard_.end(),
                                  [](const Heard& one) { return one.frame >= std::int64_t{kFrames / 2}; });
  ASSERT_NE(after, heard_.end());
  heard_.erase(heard_.begin(), after);
  expect_true_and_short(heard_);
}

TEST_F(LiveLatencyTest, AfterATrackerThatStoodStillTheNewestFrameWins) {
  pause_tracker_at_ = 10;
  const RunResult result = run();
  const auto after =
      std::find_if(heard_.begin(), heard_.end(), [](const Heard& one) { return one.frame > 10; });
  ASSERT_NE(after, heard_.end());
  heard_.erase(heard_.begin(), after);
  expect_true_and_short(heard_);
  const auto dropped = std::count_if(result.frames.begin(), result.frames.end(),
                                     [](const auto& r) { return r.state == FrameState::kDropped; });
  EXPECT_GT(dropped, 0);
}

}  // namespace
}  // namespace twofold
