// Opening a camera, against a driver of our own: what is refused, chosen, and set.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>

#include "fake_camera.hpp"

namespace twofold {
namespace {

using ::testing::HasSubstr;
using V4l2CameraStartTest = V4l2CameraTest;

TEST_F(V4l2CameraStartTest, RefusesWhatIsNoCamera) {
  device().capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_THAT(open_error(), HasSubstr("captures no video"));
  device().capabilities = V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_STREAMING;
  EXPECT_THAT(open_error(), HasSubstr("multi-planar"));
  device().capabilities = V4L2_CAP_VIDEO_CAPTURE;
  EXPECT_THAT(open_error(), HasSubstr("does not stream"));
  device().capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  device().open = true;
  EXPECT_THAT(open_error(), HasSubstr("another program"));
}

TEST_F(V4l2CameraStartTest, RefusesAnswersThatWouldLeadOutsideTheBuffers) {
  CameraOptions options;
  options.format = {PixelFormat::kGrey, 64, 48, 0};
  device().stride = 63;
  EXPECT_THAT(open_error(options), HasSubstr("bytes apart"));
  device().stride = 0xffffffff;
  EXPECT_THAT(open_error(options), HasSubstr("bytes apart"));
  device().stride = 0;
  device().buffer_bytes = kImageBytes - 1;
  EXPECT_THAT(open_error(options), HasSubstr("gives buffers of"));
  device().buffer_bytes = kImageBytes;
  device().buffer_count = 1;
  EXPECT_THAT(open_error(options), HasSubstr("gives 1 buffers"));
  device().buffer_count = 1000000;
  EXPECT_THAT(open_error(options), HasSubstr("gives 1000000 buffers"));
  device().buffer_count.reset();
  device().force_width = 128;
  EXPECT_THAT(open_error(options), HasSubstr("gives GREY 128x48 when asked for GREY 64x48"));
  device().force_width = 0;
  options.format = {PixelFormat::kGrey, 0, 0, 0};
  EXPECT_FALSE(open_error(options).empty());
}

TEST_F(V4l2CameraStartTest, ReportsFailuresOfEveryStepOfStarting) {
  for (const unsigned long request : {VIDIOC_QUERYCAP, VIDIOC_G_FMT, VIDIOC_S_FMT, VIDIOC_REQBUFS,
                                      VIDIOC_QUERYBUF, VIDIOC_QBUF, VIDIOC_STREAMON}) {
    device().errors[request].assign(1, EIO);
    EXPECT_THAT(open_error(), HasSubstr("Input/output error")) << request;
    EXPECT_EQ(calls_.open_descriptors, 0);
    EXPECT_EQ(calls_.mapped, 0);
  }
}

TEST_F(V4l2CameraStartTest, ChoosesTheCheapestFormatOffered) {
  device().formats = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_RGB24, V4L2_PIX_FMT_YUYV};
  device().bytes_per_pixel = 2;
  open();
  EXPECT_EQ(camera_->format().layout.format, PixelFormat::kYuyv);
  camera_.reset();
  device().formats = {V4L2_PIX_FMT_RGB24};
  EXPECT_THAT(open_error(), HasSubstr("no supported format"));
}

TEST_F(V4l2CameraStartTest, SetsControlsWithinTheirRanges) {
  v4l2_queryctrl query{};
  query.minimum = 1;
  query.maximum = 500;
  device().controls[V4L2_CID_EXPOSURE_ABSOLUTE] = query;
  device().controls[V4L2_CID_EXPOSURE_AUTO] = query;
  CameraOptions options;
  options.settings.exposure_us = 8000;
  open(options);
  EXPECT_EQ(device().values[V4L2_CID_EXPOSURE_ABSOLUTE], 80);
  EXPECT_EQ(device().values[V4L2_CID_EXPOSURE_AUTO], V4L2_EXPOSURE_MANUAL);
  camera_.reset();
  options.settings.exposure_us = 1e6;
  EXPECT_THAT(open_error(options), HasSubstr("must be in 1..500, is 10000"));
  options.settings.exposure_us.reset();
  options.settings.gain = 5;
  EXPECT_THAT(open_error(options), HasSubstr("no control for gain"));
}

}  // namespace
}  // namespace twofold
