#include "io/sources/v4l2_source.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "fixtures/fake_device.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/recording.hpp"
#include "io/sources/source_parameters.hpp"

namespace twofold {
namespace {

using ::testing::HasSubstr;

/// A camera whose left half is k and whose right half is 255 - k.
FakeFrame two_halves(std::uint64_t k, int width, int height) {
  FakeFrame frame;
  frame.bytes.resize(static_cast<std::size_t>(width * height));
  for (std::size_t i = 0; i < frame.bytes.size(); ++i) {
    const bool left = i % static_cast<std::size_t>(width) < static_cast<std::size_t>(width / 2);
    frame.bytes[i] = static_cast<std::uint8_t>(left ? k : 255 - k);
  }
  return frame;
}

std::unique_ptr<FakeV4l2> fake() {
  auto calls = std::make_unique<FakeV4l2>();
  calls->devices["/dev/video0"].frame = [](std::uint64_t k) { return two_halves(k, 64, 48); };
  return calls;
}

std::string error_of(const std::string& text, std::unique_ptr<FakeV4l2> calls) {
  try {
    const V4l2Source source(parse_source_spec(text), {}, std::move(calls));
  } catch (const IoError& e) {
    return e.what();
  }
  return {};
}

TEST(V4l2SourceTest, SideBySideStereo) {
  auto calls = fake();
  V4l2Source source(
      parse_source_spec("v4l2:/dev/video0?layout=side-by-side&fx=30&fy=30&cx=15.5&cy=23.5&baseline=0.1"), {},
      std::move(calls));
  EXPECT_EQ(source.rig().kind, SensorKind::kStereo);
  EXPECT_EQ(source.rig().camera.width, 32);
  EXPECT_EQ(source.rig().camera.fx, 30);
  EXPECT_EQ(source.rig().camera.cx, 15.5);
  EXPECT_EQ(source.rig().camera.cy, 23.5);
  EXPECT_EQ(source.rig().baseline, 0.1);
  EXPECT_TRUE(source.is_live());
  Frame frame;
  for (int k = 0; k < 20; ++k) {
    ASSERT_EQ(source.next(frame), FrameStatus::kFrame) << source.error();
    EXPECT_EQ(frame.index, k);
    EXPECT_EQ(frame.left.at<std::uint8_t>(20, 16), k);
    EXPECT_EQ(frame.right.at<std::uint8_t>(20, 16), 255 - k);
  }
}

TEST(V4l2SourceTest, APairOfGivenBaselineIsRectified) {
  const SourceSpec spec = parse_source_spec("v4l2:/dev/video0?fx=30&fy=30&cx=15.5&cy=23.5&baseline=0.1");
  SourceParameters parameters(spec.text, spec.parameters);
  // Resampling its images would take time between exposure and pose.
  EXPECT_TRUE(with_parameters({}, false, SensorKind::kStereo, parameters).already_rectified);
}

TEST(V4l2SourceTest, DeliveredImagesOutliveTheDriversBuffers) {
  V4l2Source source(parse_source_spec("v4l2:/dev/video0?fx=30&fy=30&cx=31.5&cy=23.5"), {}, fake());
  std::vector<Frame> frames(12);
  for (Frame& frame : frames) ASSERT_EQ(source.next(frame), FrameStatus::kFrame);
  for (int k = 0; k < 12; ++k) EXPECT_EQ(frames[static_cast<std::size_t>(k)].left.at<std::uint8_t>(0, 0), k);
}

TEST(V4l2SourceTest, TwoCamerasArePairedByTimeAndTheErrorIsReported) {
  auto calls = fake();
  constexpr std::int64_t kOffsetNs = 3'000'000;
  auto& right = calls->devices["/dev/video1"];
  right.frame = [](std::uint64_t k) {
    FakeFrame frame = two_halves(k, 64, 48);
    frame.skip = k == 7 ? 2 : 0;  // two dropped before the eighth
    return frame;
  };
  calls->devices["/dev/video0"].frame = [base = calls.get()](std::uint64_t k) {
    FakeFrame frame = two_halves(k, 64, 48);
    frame.t_ns = base->devices["/dev/video0"].next_ns - kOffsetNs;
    return frame;
  };
  SourceOptions options;
  options.raw = true;
  V4l2Source source(parse_source_spec("v4l2:/dev/video0?right=/dev/video1"), options, std::move(calls));
  EXPECT_TRUE(source.is_raw());
  EXPECT_EQ(source.rig().kind, SensorKind::kStereo);
  Frame frame;
  for (int k = 0; k < 30; ++k) {
    ASSERT_EQ(source.next(frame), FrameStatus::kFrame) << source.error();
    ASSERT_FALSE(frame.right.empty());
  }
  const SourceReport report = source.report();
  EXPECT_THAT(report.summary.back(), HasSubstr("30 pairs, 2 + 0 frames without partner"));
  EXPECT_THAT(report.summary.back(), HasSubstr("3.000 ms (most)"));
  EXPECT_EQ(report.lost, 2u);
}

TEST(V4l2SourceTest, ColourAndDepthCamera) {
  auto calls = fake();
  auto& depth = calls->devices["/dev/video1"];
  depth.formats = {V4L2_PIX_FMT_Z16};
  depth.bytes_per_pixel = 2;
  depth.frame = [](std::uint64_t) {
    FakeFrame frame;
    for (int i = 0; i < 64 * 48; ++i) {
      frame.bytes.push_back(0x34);
      frame.bytes.push_back(0x12);
    }
    return frame;
  };
  V4l2Source source(
      parse_source_spec("v4l2:/dev/video0?depth=/dev/video1&fx=60&fy=60&cx=31.5&cy=23.5&depth_scale=1000"),
      {}, std::move(calls));
  Frame frame;
  ASSERT_EQ(source.next(frame), FrameStatus::kFrame) << source.error();
  EXPECT_EQ(frame.depth.type(), CV_16UC1);
  EXPECT_EQ(frame.depth.at<std::uint16_t>(10, 10), 0x1234);
}

TEST(V4l2SourceTest, DamagedJpegsAreCountedAndSkipped) {
  auto calls = fake();
  auto& device = calls->devices["/dev/video0"];
  device.formats = {V4L2_PIX_FMT_MJPEG};
  device.frame = [](std::uint64_t) {
    FakeFrame frame;
    frame.bytes.assign(500, 0x55);
    return frame;
  };
  std::atomic<bool> stop{false};
  SourceOptions options;
  options.raw = true;
  options.stop = &stop;
  V4l2Source source(parse_source_spec("v4l2:/dev/video0"), options, std::move(calls));
  Frame frame;
  // Nothing decodable ever comes: this must end all the same.
  EXPECT_EQ(source.next(frame), FrameStatus::kError);
  EXPECT_THAT(source.error(), HasSubstr("no frame for"));
  EXPECT_THAT(source.report().faults.at(0), HasSubstr("JPEG"));
}

TEST(V4l2SourceTest, EndsWhenStopped) {
  std::atomic<bool> stop{false};
  SourceOptions options;
  options.raw = true;
  options.stop = &stop;
  V4l2Source source(parse_source_spec("v4l2:/dev/video0"), options, fake());
  Frame frame;
  ASSERT_EQ(source.next(frame), FrameStatus::kFrame);
  stop = true;
  EXPECT_EQ(source.next(frame), FrameStatus::kEnd);
}

TEST(V4l2SourceTest, RefusesWrongParameters) {
  EXPECT_THAT(error_of("v4l2:/dev/video9", fake()), HasSubstr("/dev/video9: cannot be opened: No such file"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?size=640", fake()), HasSubstr("is not WIDTHxHEIGHT"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?size=640x480x2", fake()), HasSubstr("is not WIDTHxHEIGHT"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?format=RGB3", fake()), HasSubstr("format='RGB3'"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?layout=diagonal", fake()), HasSubstr("layout="));
  EXPECT_THAT(error_of("v4l2:/dev/video0?buffers=1", fake()), HasSubstr("buffers must be in 2..32"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?right=a&depth=b", fake()), HasSubstr("exclude each other"));
  EXPECT_THAT(error_of("v4l2:/dev/video0", fake()), HasSubstr("no calibration"));
  EXPECT_THAT(error_of("v4l2:/dev/video0?fx=1&fy=1&cx=1&cy=1&oops=1", fake()), HasSubstr("oops"));
}

}  // namespace
}  // namespace twofold
