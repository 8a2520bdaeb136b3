#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fixtures/fake_device.hpp"
#include "io/v4l2/camera.hpp"

namespace twofold {

inline constexpr const char* kPath = "/dev/video0";
inline constexpr std::size_t kImageBytes = 64 * 48;

inline FakeFrame good_frame(std::uint64_t k) {
  return {std::vector<std::uint8_t>(kImageBytes, static_cast<std::uint8_t>(k)),
          {},
          0,
          V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC,
          {},
          {},
          0,
          0};
}

/// A camera on a driver of our own.
class V4l2CameraTest : public ::testing::Test {
 protected:
  V4l2CameraTest() { device().frame = good_frame; }
  ~V4l2CameraTest() override {
    camera_.reset();
    EXPECT_EQ(calls_.open_descriptors, 0) << "a descriptor leaked";
    EXPECT_EQ(calls_.mapped, 0) << "a mapping leaked";
  }

  FakeV4l2::Device& device() { return calls_.devices[kPath]; }
  void open(CameraOptions options = {}) {
    options.path = kPath;
    auto camera = V4l2Camera::open(calls_, options);
    ASSERT_TRUE(camera.has_value()) << camera.error().text;
    camera_ = std::move(*camera);
  }
  std::string open_error(CameraOptions options = {}) {
    options.path = kPath;
    auto camera = V4l2Camera::open(calls_, options);
    return camera ? "" : camera.error().text;
  }
  /// Frame k misbehaves as told; the others do not.
  void spoil(std::uint64_t which, const std::function<void(FakeFrame&)>& how) {
    device().frame = [which, how](std::uint64_t k) {
      FakeFrame frame = good_frame(k);
      if (k == which) how(frame);
      return frame;
    };
  }
  /// Reads n frames, which must come, in order of time and of index.
  std::vector<CameraFrame> read(int n) {
    std::vector<CameraFrame> frames;
    for (int i = 0; i < n; ++i) {
      CameraFrame frame;
      EXPECT_EQ(camera_->next(stop_, &frame), CameraStatus::kFrame) << camera_->problem();
      if (!frames.empty()) {
        EXPECT_GT(frame.t_ns, frames.back().t_ns);
        EXPECT_GT(frame.index, frames.back().index);
      }
      frames.push_back(frame);
    }
    return frames;
  }

  FakeV4l2 calls_;
  std::unique_ptr<V4l2Camera> camera_;
  std::atomic<bool> stop_{false};
};

}  // namespace twofold
