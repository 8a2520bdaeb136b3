#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/v4l2/device.hpp"

namespace twofold {

struct FrameSizeEntry {
  int width = 0, height = 0;          ///< or the smallest, if a range
  int max_width = 0, max_height = 0;  ///< equal to width, height for a single size
  std::vector<double> fps;            ///< offered rates, fastest first; for a range of rates, its ends
  bool fps_range = false;
};

struct FormatEntry {
  std::uint32_t fourcc = 0;
  std::string description;
  std::optional<PixelFormat> format;  ///< nothing when it is none we can use
  std::vector<FrameSizeEntry> sizes;

  /// Whether the size is there, at >= 0.9 fps where fps > 0. A device that lists no sizes (rates) is believed
  /// to have all.
  [[nodiscard]] bool offers(int width, int height, double fps) const;
};

struct ControlEntry {
  std::uint32_t id = 0;
  std::string name;
  std::int64_t minimum = 0, maximum = 0, step = 0, default_value = 0;
  std::optional<std::int32_t> value;
  bool inactive = false;          ///< without effect now: an automatic has it
  std::vector<std::string> menu;  ///< "0: Auto", ...; empty for numbers
};

/// Everything a device lists; lists are cut after 256 entries each, in case it never ends one.
[[nodiscard]] std::vector<FormatEntry> enumerate_formats(const V4l2Device& device);
[[nodiscard]] std::vector<ControlEntry> enumerate_controls(const V4l2Device& device);

}  // namespace twofold
