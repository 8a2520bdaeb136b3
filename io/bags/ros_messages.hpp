#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "camera/camera_info.hpp"
#include "io/bags/bag_reader.hpp"

namespace twofold {

/// sensor_msgs/Image; the pixels are the message's own bytes.
struct ImageMessage {
  std::int64_t t_ns = 0;  ///< header.stamp
  std::uint32_t width = 0, height = 0;
  std::string encoding;
  bool big_endian = false;
  std::uint32_t step = 0;  ///< bytes of a row
  std::span<const std::uint8_t> pixels;
};

/// sensor_msgs/CompressedImage.
struct CompressedImageMessage {
  std::int64_t t_ns = 0;  ///< header.stamp
  std::string format;     ///< "jpeg", "png", "16UC1; compressedDepth" and the like
  std::span<const std::uint8_t> file;
};

// All throw MalformedBytes when the message is cut short or its lengths make no sense.
[[nodiscard]] ImageMessage parse_image(std::span<const std::uint8_t> message, MessageEncoding encoding);
[[nodiscard]] CompressedImageMessage parse_compressed_image(std::span<const std::uint8_t> message,
                                                            MessageEncoding encoding);
[[nodiscard]] CameraInfoMessage parse_camera_info(std::span<const std::uint8_t> message,
                                                  MessageEncoding encoding);

}  // namespace twofold
