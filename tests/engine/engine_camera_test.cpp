// A recorded sequence played through a camera's driver, and a live run repeated from its recording.
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "engine/engine.hpp"
#include "fixtures/fake_device.hpp"
#include "fixtures/side_by_side_camera.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recording_tee.hpp"
#include "io/sources/synthetic_source.hpp"
#include "io/sources/v4l2_source.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/sanitized.hpp"

namespace twofold {
namespace {

constexpr int kFrames = 50;

/// Rendered stereo frames, as a file would give them and as a camera with both images in one stream does.
class EngineCameraTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    const auto source = open_synthetic(
        "desk", {{"width", "320"}, {"height", "240"}, {"fps", "25"}, {"frames", std::to_string(kFrames)}});
    rig_ = new Rig(source->rig());
    frames_ = new std::vector<Frame>(kFrames);
    for (Frame& frame : *frames_) ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  }
  static void TearDownTestSuite() {
    delete frames_;
    delete rig_;
  }

  static FakeFrame stream_frame(std::uint64_t k, std::uint32_t format) {
    const cv::Mat both = testing::side_by_side(frames_->at(std::min<std::size_t>(k, kFrames - 1)));
    FakeFrame made;
    if (format == V4L2_PIX_FMT_MJPEG) {
      cv::imencode(".jpg", both, made.bytes, {cv::IMWRITE_JPEG_QUALITY, 95});
      return made;
    }
    const int bytes_per_pixel = format == V4L2_PIX_FMT_GREY ? 1 : 2;
    for (std::size_t i = 0; i < both.total(); ++i) {
      made.bytes.push_back(both.data[i]);
      if (bytes_per_pixel == 2) made.bytes.push_back(128);  // no colour
    }
    return made;
  }

  static std::unique_ptr<FrameSource> camera(std::uint32_t format) {
    auto driver = std::make_unique<FakeV4l2>();
    FakeV4l2::Device& device = driver->devices["/dev/video0"];
    testing::set_up_side_by_side(device, *rig_, format);
    device.frame = [format](std::uint64_t k) { return stream_frame(k, format); };
    return std::make_unique<V4l2Source>(parse_source_spec(testing::side_by_side_source(*rig_)),
                                        SourceOptions{}, std::move(driver));
  }

  /// The source's first frames: a camera has no last one.
  static FrameFeed feed(FrameSource& source) {
    return [&source, n = 0](Frame& frame) mutable {
      if (n++ == kFrames) return FrameStatus::kEnd;
      return source.next(frame) == FrameStatus::kFrame ? FrameStatus::kFrame : FrameStatus::kError;
    };
  }
  static FrameFeed file_feed() {
    return [n = std::size_t{0}](Frame& frame) mutable {
      if (n == frames_->size()) return FrameStatus::kEnd;
      frame = (*frames_)[n++];
      return FrameStatus::kFrame;
    };
  }

  static RunResult run(const FrameFeed& frames, const EngineOptions& options) {
    std::atomic<bool> interrupted{false};
    return Engine(*rig_, options).run(frames, interrupted);
  }

  /// Largest distance between the two runs' camera centres [m].
  static double farthest_apart(const RunResult& a, const RunResult& b) {
    double farthest = 0;
    for (std::size_t i = 0; i < a.frames.size(); ++i) {
      const Vector3 eye_a = final_T_c_w(a.frames[i], a.graph).inverse().translation();
      const Vector3 eye_b = final_T_c_w(b.frames[i], b.graph).inverse().translation();
      farthest = std::max(farthest, (eye_a - eye_b).norm());
    }
    return farthest;
  }
  static void expect_all_tracked(const RunResult& result) {
    EXPECT_EQ(result.error, "");
    ASSERT_EQ(result.frames.size(), static_cast<std::size_t>(kFrames));
    for (const FrameRecord& record : result.frames)
      EXPECT_EQ(record.state, FrameState::kTracked) << record.frame_index << describe(record.cause);
  }

  static Rig* rig_;
  static std::vector<Frame>* frames_;
};
Rig* EngineCameraTest::rig_ = nullptr;
std::vector<Frame>* EngineCameraTest::frames_ = nullptr;

TEST_F(EngineCameraTest, ASequencePlayedThroughACameraGivesTheTrajectoryOfItsFile) {
  EngineOptions options;
  options.deterministic = true;
  const RunResult file = run(file_feed(), options);
  expect_all_tracked(file);
  for (const std::uint32_t format : {V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_YUYV, V4L2_PIX_FMT_MJPEG}) {
    const auto source = camera(format);
    const RunResult live = run(feed(*source), options);
    expect_all_tracked(live);
    // The first two carry the luminance as it is; JPEG adds about a grey level of error.
    EXPECT_LE(farthest_apart(file, live), format == V4L2_PIX_FMT_MJPEG ? 0.003 : 0.0) << format;
  }
}

TEST_F(EngineCameraTest, ALiveRunIsRepeatedFromItsRecordingAndSchedule) {
  ScratchFolder scratch;
  EngineOptions options;
  options.pacing.speed = testing::kSanitized ? 0.2 : 1;
  RunResult live;
  {
    RecordingTee source(camera(V4L2_PIX_FMT_GREY), scratch.path() / "recording");
    live = run(feed(source), options);
    EXPECT_TRUE(source.report().faults.empty()) << source.report().faults.front();
  }
  expect_all_tracked(live);
  std::stringstream file;
  ASSERT_TRUE(write_schedule(file, live.schedule));
  const auto schedule = read_schedule(file);
  ASSERT_TRUE(schedule) << schedule.error();

  const auto recording = open_source("euroc:" + (scratch / "recording"));
  std::atomic<bool> interrupted{false};
  const RunResult repeated =
      Engine(recording->rig(), options).replay(feed(*recording), *schedule, interrupted);
  expect_all_tracked(repeated);
  for (std::size_t i = 0; i < live.frames.size(); ++i) {
    EXPECT_EQ(live.frames[i].T_c_w_causal, repeated.frames[i].T_c_w_causal) << i;
    EXPECT_EQ(live.frames[i].t_ns, repeated.frames[i].t_ns) << i;
  }
  EXPECT_EQ(farthest_apart(live, repeated), 0);
}

}  // namespace
}  // namespace twofold
