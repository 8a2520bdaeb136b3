// The capture state machine against a driver of our own: what it delivers, counts, and survives.
#include "io/v4l2/camera.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "fake_camera.hpp"

namespace twofold {
namespace {

using ::testing::HasSubstr;

TEST_F(V4l2CameraTest, DeliversEveryFrameOfAFaultlessCameraInPlace) {
  open();
  for (int k = 0; k < 100; ++k) {
    CameraFrame frame;
    ASSERT_EQ(camera_->next(stop_, &frame), CameraStatus::kFrame);
    ASSERT_EQ(frame.image.size(), kImageBytes);
    EXPECT_EQ(frame.image.front(), k);
    EXPECT_EQ(frame.image.back(), k);
    EXPECT_EQ(frame.index, static_cast<std::uint64_t>(k));
  }
  EXPECT_EQ(camera_->report().frames, 100u);
  EXPECT_EQ(camera_->report().lost(), 0u);
  EXPECT_TRUE(camera_->report().events.empty());
}

TEST_F(V4l2CameraTest, CountsSequenceGapsExactlyAndAcrossTheWrap) {
  device().first_sequence = 0xfffffff0u;
  device().frame = [](std::uint64_t k) {
    FakeFrame frame = good_frame(k);
    frame.skip = k % 10 == 5 ? 3 : 0;
    return frame;
  };
  open();
  const auto frames = read(50);
  EXPECT_EQ(camera_->report().dropped, 15u);
  EXPECT_EQ(frames.back().index, 49u + 15u);
}

TEST_F(V4l2CameraTest, SkipsAndCountsDamagedFrames) {
  spoil(3, [](FakeFrame& frame) { frame.flags |= V4L2_BUF_FLAG_ERROR; });
  open();
  const auto frames = read(10);
  EXPECT_EQ(camera_->report().damaged, 1u);
  EXPECT_EQ(frames[3].index, 4u);
  EXPECT_THAT(camera_->report().events.at(0), HasSubstr("flagged"));
}

TEST_F(V4l2CameraTest, NeverHandsOutMoreOrFewerBytesThanAnImageNeeds) {
  for (const std::uint32_t lie : {0u, std::uint32_t{kImageBytes - 1}, 64u * 48u * 4u + 1, 0xffffffffu}) {
    spoil(2, [lie](FakeFrame& frame) { frame.bytesused = lie; });
    device().produced = 0;
    open();
    read(5);
    EXPECT_EQ(camera_->report().damaged, 1u) << lie;
    EXPECT_EQ(camera_->report().restarts, 0u);
    camera_.reset();
  }
}

TEST_F(V4l2CameraTest, RestartsWhenTheDriverNamesABufferItDoesNotHave) {
  for (const std::uint32_t lie : {4u, 0xffffffffu}) {
    spoil(2, [lie](FakeFrame& frame) { frame.index = lie; });
    device().produced = 0;
    open();
    read(5);
    EXPECT_EQ(camera_->report().restarts, 1u);
    EXPECT_THAT(camera_->report().events.at(0), HasSubstr("was not queued"));
    camera_.reset();
  }
}

TEST_F(V4l2CameraTest, RestartsAfterAStreamingErrorAndCountsTheTimeMissed) {
  spoil(10, [](FakeFrame& frame) { frame.dqbuf_error = EIO; });
  open();
  const auto frames = read(20);
  EXPECT_EQ(camera_->report().restarts, 1u);
  EXPECT_EQ(camera_->report().missed_in_restarts, 1u);  // frame 10 itself
  const double intervals = static_cast<double>(frames[10].t_ns - frames[9].t_ns) * 25e-9;
  EXPECT_NEAR(intervals, static_cast<double>(frames[10].index - frames[9].index), 0.5);
  EXPECT_THAT(camera_->report().events.at(0), HasSubstr("Input/output error"));
}

TEST_F(V4l2CameraTest, WaitsAgainWhenAReadyDeviceHasNothing) {
  spoil(4, [](FakeFrame& frame) { frame.dqbuf_error = EAGAIN; });
  open();
  read(10);
  EXPECT_EQ(camera_->report().restarts, 0u);
}

TEST_F(V4l2CameraTest, SurvivesAReplug) {
  open();
  read(5);
  device().absent_until_ns = calls_.time_ns + 3'000'000'000;
  const auto frames = read(5);
  EXPECT_EQ(camera_->report().restarts, 1u);
  EXPECT_NEAR(static_cast<double>(camera_->report().missed_in_restarts), 75, 5);  // 3 s at 25 fps
  EXPECT_THAT(camera_->report().events.at(0), HasSubstr("No such device"));
}

TEST_F(V4l2CameraTest, RefusesAnotherCameraInTheSamePlace) {
  open();
  read(5);
  device().absent_until_ns = calls_.time_ns + 1'000'000'000;
  device().card = "somebody else's";
  CameraFrame frame;
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kLost);
  EXPECT_THAT(camera_->problem(), HasSubstr("another camera"));
}

TEST_F(V4l2CameraTest, GivesUpOnACameraThatStaysAway) {
  open();
  read(5);
  const std::int64_t before_ns = calls_.time_ns;
  device().absent_until_ns = before_ns + 3'600'000'000'000;
  CameraFrame frame;
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kLost);
  EXPECT_NEAR(static_cast<double>(calls_.time_ns - before_ns) * 1e-9, 12, 0.5);
  EXPECT_THAT(camera_->problem(), HasSubstr("No such device"));
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kLost);
}

TEST_F(V4l2CameraTest, RestartsASilentStreamAndGivesUpInTheEnd) {
  spoil(5, [](FakeFrame& frame) { frame.delay_ns = 5'000'000'000; });
  open();
  read(8);
  EXPECT_EQ(camera_->report().restarts, 1u);
  EXPECT_THAT(camera_->report().events.at(0), HasSubstr("no frame for 2000 ms"));

  device().frame = [](std::uint64_t k) {
    FakeFrame frame = good_frame(k);
    frame.delay_ns = 3'600'000'000'000;
    return frame;
  };
  CameraFrame frame;
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kLost);
}

TEST_F(V4l2CameraTest, DoesNotSpinOnADeviceThatFailsAtOnce) {
  open();
  read(2);
  device().frame = [](std::uint64_t k) {
    FakeFrame frame = good_frame(k);
    frame.dqbuf_error = EIO;
    return frame;
  };
  const std::int64_t before_ns = calls_.time_ns;
  CameraFrame frame;
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kLost);
  EXPECT_LT(camera_->report().restarts, 150u);
  EXPECT_LT(calls_.time_ns - before_ns, 13'000'000'000);
}

TEST_F(V4l2CameraTest, RestartsWhenABufferCannotBeHandedBack) {
  open();
  read(3);
  device().errors[VIDIOC_QBUF] = {EINVAL};
  read(5);
  EXPECT_EQ(camera_->report().restarts, 1u);
}

TEST_F(V4l2CameraTest, StampsOnArrivalWhenTheDriversTimeIsOfNoUse) {
  for (const bool unknown : {true, false}) {
    device().frame = [unknown](std::uint64_t k) {
      FakeFrame frame = good_frame(k);
      if (unknown) frame.flags = V4L2_BUF_FLAG_TIMESTAMP_UNKNOWN;
      frame.t_ns = 77'000'000'000'000'000 + static_cast<std::int64_t>(k);
      return frame;
    };
    open();
    const auto frames = read(10);
    EXPECT_TRUE(camera_->report().stamped_on_arrival);
    EXPECT_EQ(frames.back().t_ns, calls_.time_ns);
    camera_.reset();
  }
}

TEST_F(V4l2CameraTest, LeavesOutAFrameWhoseTimeRunsBackwards) {
  spoil(5, [this](FakeFrame& frame) { frame.t_ns = calls_.time_ns - 500'000'000; });
  open();
  read(10);
  EXPECT_EQ(camera_->report().damaged, 1u);
}

TEST_F(V4l2CameraTest, StopsWhenAsked) {
  open();
  read(1);
  stop_ = true;
  CameraFrame frame;
  EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kStopped);
}

}  // namespace
}  // namespace twofold
