#pragma once

#include <fmt/format.h>

#include "fixtures/bag_writer.hpp"
#include "io/sources/frame_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold::testing {

inline constexpr int kWidth = 64, kHeight = 48, kCount = 5;

/// Of a rectified pair, or its left camera: fx = 50, baseline 0.2 m.
inline WrittenCameraInfo rectified_info(bool right) {
  WrittenCameraInfo info;
  info.width = kWidth;
  info.height = kHeight;
  info.D = {0, 0, 0, 0, 0};
  info.K = {50, 0, 32, 0, 50, 24, 0, 0, 1};
  info.P = {50, 0, 32, right ? -10.0 : 0, 0, 50, 24, 0, 0, 0, 1, 0};
  return info;
}

inline std::int64_t time_of(int frame) {
  return 1'700'000'000'000'000'000 + frame * 100'000'000LL;
}

/// A stereo camera beside a topic of something else; the right images come first.
inline WrittenBag stereo_bag(MessageEncoding encoding) {
  WrittenBag bag;
  bag.topics = {{"/points", "sensor_msgs/PointCloud2"},
                {"/stereo/left/image_rect", "sensor_msgs/Image"},
                {"/stereo/left/camera_info", "sensor_msgs/CameraInfo"},
                {"/stereo/right/image_rect", "sensor_msgs/Image"},
                {"/stereo/right/camera_info", "sensor_msgs/CameraInfo"}};
  for (int i = 0; i < kCount; ++i) {
    const std::int64_t t = time_of(i);
    bag.messages.push_back({0, t, Bytes(100, 1)});
    bag.messages.push_back(
        {3, t, image_message(encoding, t, numbered_image(kWidth, kHeight, 100 + i), "mono8")});
    bag.messages.push_back({4, t, camera_info_message(encoding, rectified_info(true))});
    bag.messages.push_back({1, t, image_message(encoding, t, numbered_image(kWidth, kHeight, i), "mono8")});
    bag.messages.push_back({2, t, camera_info_message(encoding, rectified_info(false))});
  }
  return bag;
}

inline std::string text_of(const Bytes& bytes) {
  return {bytes.begin(), bytes.end()};
}

/// What a source ends with: its error, or how many frames it gave.
inline std::string drain(FrameSource& source) {
  Frame frame;
  for (int count = 0;; ++count) {
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kEnd) return std::to_string(count);
    if (status == FrameStatus::kError) return source.error();
  }
}

}  // namespace twofold::testing
