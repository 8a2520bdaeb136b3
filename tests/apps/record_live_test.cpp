// `twofold record`: whatever ends it, the folder is a recording up to there and every lost frame is reported.
#include <functional>
#include <set>

#include <fmt/format.h>

#include "apps/twofold/record_session.hpp"
#include "fixtures/fake_device.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/v4l2_source.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 64, kHeight = 48;

Calibration test_calibration() {
  Rig rig;
  rig.kind = SensorKind::kMono;
  rig.camera = {60, 60, 31.5, 23.5, kWidth, kHeight};
  return calibration_of(rig);
}

/// Frames that can be read back, by their index; fails the test unless the recording is sound to its end.
std::vector<Frame> read_back(const fs::path& recording) {
  std::vector<Frame> frames;
  const auto source = open_source(recording.string());
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
    frames.push_back(frame);
    frames.back().left = frame.left.clone();
  }
  EXPECT_EQ(source->error(), "");
  for (const char* camera : {"cam0", "cam1"}) {
    const fs::path data = recording / "mav0" / camera / "data";
    if (!fs::exists(data)) continue;
    for (const auto& file : fs::directory_iterator(data))
      EXPECT_EQ(file.path().extension(), ".png") << "left over: " << file.path();
  }
  return frames;
}

/// A camera that takes no longer over 1000 frames than it must: the disk is sure to be slower.
class RecordLive : public ::testing::Test {
 protected:
  static constexpr std::uint64_t kLast = 400;  // frame at which Ctrl-C is pressed

  /// fault(k) changes the k-th frame of the camera.
  RecordOutcome record(std::size_t queue, const std::function<void(std::uint64_t, FakeFrame&)>& fault) {
    FakeV4l2::Device& device = driver_->devices["/dev/video0"];
    device.frame = [this, fault](std::uint64_t k) {
      if (k >= kLast) stop_ = true;
      FakeFrame frame;
      frame.bytes.assign(kWidth * kHeight, static_cast<std::uint8_t>(k));
      fault(k, frame);
      return frame;
    };
    SourceOptions options;
    options.raw = true;
    options.stop = &stop_;
    V4l2Source source(parse_source_spec("v4l2:/dev/video0"), options, std::move(driver_));
    RecorderOptions recorder_options;
    recorder_options.queue_frames = queue;
    Recorder recorder(recording(), SensorKind::kMono, test_calibration(), recorder_options);
    return record_from(source, recorder, 0, stop_, [] {});
  }
  [[nodiscard]] fs::path recording() const { return folder_.path() / "r"; }

  ScratchFolder folder_;
  std::atomic<bool> stop_{false};
  std::unique_ptr<FakeV4l2> driver_ = std::make_unique<FakeV4l2>();
};

TEST_F(RecordLive, InterruptedItHoldsEveryFrameTheCameraGaveAndNamesThoseItDidNot) {
  const RecordOutcome outcome = record(1000, [](std::uint64_t k, FakeFrame& frame) {
    if (k == 100) frame.skip = 3;
    if (k == 200) frame.flags |= V4L2_BUF_FLAG_ERROR;
    if (k == 300) frame.bytesused = 17;
  });
  EXPECT_TRUE(outcome.all_written()) << outcome.problem;
  EXPECT_EQ(outcome.report.lost, 5U);
  // The frame that was on its way when the key was pressed may still have come.
  EXPECT_GE(outcome.counts.written, kLast - 2);
  EXPECT_LE(outcome.counts.written, kLast - 1);
  const auto frames = read_back(recording());
  ASSERT_EQ(frames.size(), outcome.counts.written);
  std::set<int> missing;
  for (int k = 0; k < 256; ++k) missing.insert(k);
  for (const Frame& frame : frames) missing.erase(frame.left.at<std::uint8_t>(0, 0));
  EXPECT_TRUE(missing.contains(200)) << "the damaged one is not among them (no other is of value 200)";
  EXPECT_EQ(missing.size(), 1U);
  const std::string text = describe(outcome);
  EXPECT_NE(text.find("lost: 5 by the camera, 0 because"), std::string::npos) << text;
  EXPECT_NE(text.find("3 dropped before they came, 2 damaged"), std::string::npos) << text;
}

TEST_F(RecordLive, ADiskThatIsTooSlowLosesFramesButNoneUnreported) {
  std::uint64_t given = 0;
  const RecordOutcome outcome = record(2, [&](std::uint64_t, FakeFrame&) { ++given; });
  EXPECT_EQ(outcome.problem, "");
  EXPECT_GT(outcome.counts.refused, 0U);
  EXPECT_FALSE(outcome.all_written());
  EXPECT_LE(given - (outcome.counts.written + outcome.counts.refused), 1U);  // the one at Ctrl-C
  EXPECT_EQ(read_back(recording()).size(), outcome.counts.written);
}

TEST_F(RecordLive, ACameraThatIsGoneForGoodEndsAValidRecordingWithItsName) {
  FakeV4l2* driver = driver_.get();
  const RecordOutcome outcome = record(1000, [driver](std::uint64_t k, FakeFrame&) {
    if (k == 50) driver->devices["/dev/video0"].absent_until_ns = driver->time_ns + 3'600'000'000'000;
  });
  EXPECT_NE(outcome.problem.find("/dev/video0"), std::string::npos) << outcome.problem;
  EXPECT_EQ(outcome.counts.written, 50U);
  EXPECT_EQ(read_back(recording()).size(), 50U);
}

/// Frames of the line "...: N frames, ...".
std::size_t frames_said(const std::string& out) {
  const auto at = out.find(" frames,");
  return at == std::string::npos ? 0 : std::stoul(out.substr(out.rfind(' ', at - 1) + 1));
}

TEST(RecordCommand, ControlCEndsItWell) {
  const ScratchFolder folder;
  // Not after a fixed time: on a busy machine nothing might be written by then.
  const std::string script = folder / "interrupted.sh";
  std::ofstream(script) << "\"$@\" & command=$!\n"
                        << "while kill -0 $command && [ $(find " << (folder / "r")
                        << " -name '*.png' | wc -l) -lt 3 ]; do sleep 0.05; done\n"
                        << "kill -INT $command\nwait $command\n";
  const Outcome outcome =
      run(folder, "record 'synthetic:desk?width=160&height=120&frames=1000000' " + (folder / "r"),
          "sh " + script);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_GT(frames_said(outcome.out), 0U);
  EXPECT_EQ(read_back(folder.path() / "r").size(), frames_said(outcome.out));
}

TEST(RecordCommand, AFullDiskEndsItWithTheReasonAndAValidRecording) {
  const ScratchFolder folder;
  fs::create_directory(folder.path() / "disk");
  const std::string mount = "mount -t tmpfs -o size=1m none " + (folder / "disk");
  if (std::system(("unshare -rm sh -c '" + mount + "' 2>/dev/null").c_str()) != 0)
    GTEST_SKIP() << "no file system of a limited size can be mounted here";
  // The mount is seen by the commands inside only: what is on it is copied before it goes.
  const std::string script = folder / "full.sh";
  std::ofstream(script) << mount << "\n\"$@\"\nstatus=$?\ncp -r " << (folder / "disk") << "/r "
                        << (folder / "r") << "\nexit $status\n";
  const Outcome outcome =
      run(folder, "record 'synthetic:desk?width=160&height=120&frames=1000' " + (folder / "disk/r"),
          "unshare -rm sh " + script);
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("No space left on device"), std::string::npos) << outcome.err;
  EXPECT_GT(frames_said(outcome.out), 5U) << outcome.out;
  EXPECT_EQ(outcome.out.find(" 0 because writing"), std::string::npos) << outcome.out;
  EXPECT_EQ(read_back(folder.path() / "r").size(), frames_said(outcome.out));
}

}  // namespace
}  // namespace twofold
