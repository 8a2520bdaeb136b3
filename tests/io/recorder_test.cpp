#include "io/sources/recorder.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>
#include <opencv2/core.hpp>

#include "io/files/calibration_file.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

Rig test_rig(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {81.25, 81.25, 39.5, 29.75, 80, 60};
  rig.baseline = 0.1234567890123;
  return rig;
}

/// Noise does not compress: the PNG is as large as the image.
Frame test_frame(int k, bool noise = false) {
  Frame frame;
  frame.index = k;
  frame.t_ns = 1'000'000'000 + 40'000'000LL * k;
  frame.left = cv::Mat(60, 80, CV_8UC1, cv::Scalar(k));
  frame.right = cv::Mat(60, 80, CV_8UC1, cv::Scalar(255 - k));
  if (noise) {
    cv::RNG random(5);
    random.fill(frame.right, cv::RNG::UNIFORM, 0, 256);
  }
  return frame;
}

TEST(RecorderTest, WhatIsRecordedReadsBackBitForBit) {
  const ScratchFolder scratch;
  const Rig rig = test_rig(SensorKind::kStereo);
  {
    Recorder recorder(scratch.path() / "r", rig.kind, calibration_of(rig));
    for (int k = 0; k < 20; ++k) ASSERT_TRUE(recorder.offer(test_frame(k), true));
    EXPECT_EQ(recorder.finish(), "");
    EXPECT_EQ(recorder.counts().written, 20u);
    EXPECT_EQ(recorder.counts().refused, 0u);
  }
  const auto source = open_source((scratch.path() / "r").string());
  EXPECT_EQ(source->rig().camera.fx, rig.camera.fx);
  EXPECT_EQ(source->rig().camera.cy, rig.camera.cy);
  EXPECT_EQ(source->rig().baseline, rig.baseline);
  Frame frame;
  for (int k = 0; k < 20; ++k) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.t_ns, test_frame(k).t_ns);
    EXPECT_EQ(cv::norm(frame.left, test_frame(k).left, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(frame.right, test_frame(k).right, cv::NORM_INF), 0);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
}

TEST(RecorderTest, TheLensIsKeptDigitByDigit) {
  const ScratchFolder scratch;
  const Distortion lenses[] = {
      {DistortionModel::kRadTan, {-0.1, 1.0 / 3, 1e-4, -2e-5, 0.03}},
      {DistortionModel::kEquidistant, {0.1, 1.0 / 3, 1e-4, -2e-5}},
      {DistortionModel::kDoubleSphere, {-0.2, 1.0 / 3}},
      {DistortionModel::kRational, {0.1, -1.0 / 3, 1e-4, -2e-5, 0.03, 0.05, -0.7, 2.0 / 3}}};
  for (const Distortion& lens : lenses) {
    Calibration calibration = calibration_of(test_rig(SensorKind::kMono));
    calibration.left.distortion = lens;
    const fs::path folder = scratch.path() / std::to_string(static_cast<int>(lens.model));
    { const Recorder recorder(folder, SensorKind::kMono, calibration); }
    const EurocCamera read = read_euroc_camera(folder / "mav0/cam0/sensor.yaml");
    EXPECT_EQ(read.model.distortion.model, lens.model);
    EXPECT_EQ(read.model.distortion.coefficients, lens.coefficients);
  }
}

/// A schedule belongs to a rig, of which the readout is a part: without it no recording could be replayed.
TEST(RecorderTest, TheReadoutOfARollingShutterIsKept) {
  const ScratchFolder scratch;
  for (const std::optional<double> readout :
       {std::optional<double>(), std::optional(0.0), std::optional(1.0 / 55)}) {
    Rig rig = test_rig(SensorKind::kStereo);
    rig.readout = readout;
    const fs::path folder = scratch.path() / (readout ? std::to_string(*readout) : "unknown");
    {
      Recorder recorder(folder, rig.kind, calibration_of(rig));
      ASSERT_TRUE(recorder.offer(test_frame(0), true));
    }
    EXPECT_EQ(open_source(folder.string())->rig().readout, readout);
    EXPECT_EQ(read_calibration(folder / "mav0/cam0/sensor.yaml").readout, readout);
  }
}

TEST(RecorderTest, EveryFrameThatDoesNotFitTheQueueIsCounted) {
  const ScratchFolder scratch;
  RecorderOptions options;
  options.queue_frames = 2;
  Recorder recorder(scratch.path() / "r", SensorKind::kMono, std::nullopt, options);
  std::uint64_t accepted = 0;
  constexpr std::uint64_t kOffered = 500;
  for (std::uint64_t k = 0; k < kOffered; ++k)
    accepted += recorder.offer(test_frame(static_cast<int>(k)), false);
  EXPECT_EQ(recorder.finish(), "");
  EXPECT_EQ(recorder.counts().written, accepted);
  EXPECT_EQ(recorder.counts().refused, kOffered - accepted);
  EXPECT_EQ(recorder.counts().queued, 0u);
  EXPECT_LT(accepted, kOffered);
}

TEST(RecorderTest, AFailedWriteIsReportedAndLeavesAValidRecording) {
  const ScratchFolder scratch;
  const Rig rig = test_rig(SensorKind::kStereo);
  Recorder recorder(scratch.path() / "r", rig.kind, calibration_of(rig));
  // No file may grow beyond 2000 bytes from here on; as with a full disk, write answers with an error.
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{2000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  for (int k = 0; k < 30; ++k)
    [[maybe_unused]] const bool taken = recorder.offer(test_frame(k, k >= 12), true);
  const std::string problem = recorder.finish();
  setrlimit(RLIMIT_FSIZE, &before);

  EXPECT_NE(problem, "");
  EXPECT_TRUE(recorder.failed());
  EXPECT_EQ(recorder.counts().written, 12u);
  EXPECT_EQ(recorder.counts().written + recorder.counts().refused, 30u);
  const auto source = open_source((scratch.path() / "r").string());
  Frame frame;
  int frames = 0;
  while (source->next(frame) == FrameStatus::kFrame) ++frames;
  EXPECT_EQ(source->error(), "");
  EXPECT_EQ(frames, 12);
}

TEST(RecorderTest, DoesNotTouchAnExistingRecordingAndRefusesDepth) {
  const ScratchFolder scratch;
  { const Recorder first(scratch.path() / "r", SensorKind::kMono, std::nullopt); }
  EXPECT_THROW(Recorder(scratch.path() / "r", SensorKind::kMono, std::nullopt), IoError);
  EXPECT_THROW(Recorder(scratch.path() / "d", SensorKind::kRgbd, std::nullopt), IoError);
}

}  // namespace
}  // namespace twofold
