#pragma once

#include <filesystem>

#include "doctor/finding.hpp"
#include "io/v4l2/device.hpp"

namespace twofold {

/// Whether a camera offers the format asked for, and whether the bus it hangs on carries it.
///
/// @param root  where sys/ is: "/", or a tree of a test
[[nodiscard]] std::vector<Finding> check_camera(V4l2Calls& calls, const std::filesystem::path& root,
                                                const std::string& device, const CaptureFormat& wanted);

/// Bytes a second of images in a format; MJPG is taken for a fifth of a byte a pixel.
[[nodiscard]] double stream_bytes_per_second(PixelFormat format, int width, int height, double fps);

}  // namespace twofold
