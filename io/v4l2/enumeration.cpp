#include "io/v4l2/enumeration.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cstring>
#include <functional>

#include <fmt/format.h>

namespace twofold {
namespace {

constexpr std::uint32_t kLongestList = 256;

template <class Byte, std::size_t kSize>
std::string text_of(const Byte (&field)[kSize]) {
  const auto* begin = reinterpret_cast<const char*>(field);
  std::string text(begin, strnlen(begin, kSize));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, '?');
  return text;
}

double rate(const v4l2_fract& interval) {
  return interval.numerator == 0 ? 0 : static_cast<double>(interval.denominator) / interval.numerator;
}

void enumerate_rates(const V4l2Device& device, std::uint32_t fourcc, FrameSizeEntry* size) {
  for (std::uint32_t i = 0; i < kLongestList; ++i) {
    v4l2_frmivalenum entry{};
    entry.index = i;
    entry.pixel_format = fourcc;
    entry.width = static_cast<std::uint32_t>(size->width);
    entry.height = static_cast<std::uint32_t>(size->height);
    if (device.calls().ioctl(device.fd(), VIDIOC_ENUM_FRAMEINTERVALS, &entry) < 0) break;
    if (entry.type == V4L2_FRMIVAL_TYPE_DISCRETE) {
      size->fps.push_back(rate(entry.discrete));
    } else {
      size->fps = {rate(entry.stepwise.min), rate(entry.stepwise.max)};
      size->fps_range = true;
      break;
    }
  }
  std::sort(size->fps.begin(), size->fps.end(), std::greater<>());
}

void enumerate_sizes(const V4l2Device& device, FormatEntry* format) {
  for (std::uint32_t i = 0; i < kLongestList; ++i) {
    v4l2_frmsizeenum entry{};
    entry.index = i;
    entry.pixel_format = format->fourcc;
    if (device.calls().ioctl(device.fd(), VIDIOC_ENUM_FRAMESIZES, &entry) < 0) break;
    const auto clamped = [](std::uint32_t v) { return static_cast<int>(std::min(v, 65536U)); };
    FrameSizeEntry size;
    if (entry.type == V4L2_FRMSIZE_TYPE_DISCRETE) {
      size.width = size.max_width = clamped(entry.discrete.width);
      size.height = size.max_height = clamped(entry.discrete.height);
    } else {
      size.width = clamped(entry.stepwise.min_width);
      size.height = clamped(entry.stepwise.min_height);
      size.max_width = clamped(entry.stepwise.max_width);
      size.max_height = clamped(entry.stepwise.max_height);
    }
    enumerate_rates(device, format->fourcc, &size);
    format->sizes.push_back(std::move(size));
    if (entry.type != V4L2_FRMSIZE_TYPE_DISCRETE) break;
  }
}

std::vector<std::string> enumerate_menu(const V4l2Device& device, const v4l2_queryctrl& query) {
  std::vector<std::string> menu;
  const std::int64_t end = std::min<std::int64_t>(query.maximum, std::int64_t{query.minimum} + kLongestList);
  for (std::int64_t i = query.minimum; i <= end; ++i) {
    v4l2_querymenu item{};
    item.id = query.id;
    item.index = static_cast<std::uint32_t>(i);
    if (device.calls().ioctl(device.fd(), VIDIOC_QUERYMENU, &item) < 0) continue;  // menus have holes
    menu.push_back(query.type == V4L2_CTRL_TYPE_MENU ? fmt::format("{}: {}", i, text_of(item.name))
                                                     : fmt::format("{}: {}", i, std::int64_t{item.value}));
  }
  return menu;
}

ControlEntry read_control(const V4l2Device& device, const v4l2_queryctrl& query) {
  ControlEntry control{query.id,   text_of(query.name), query.minimum, query.maximum,
                       query.step, query.default_value, std::nullopt,  false,
                       {}};
  control.inactive = (query.flags & V4L2_CTRL_FLAG_INACTIVE) != 0;
  v4l2_control value{query.id, 0};
  if (device.calls().ioctl(device.fd(), VIDIOC_G_CTRL, &value) == 0) control.value = value.value;
  if (query.type == V4L2_CTRL_TYPE_MENU || query.type == V4L2_CTRL_TYPE_INTEGER_MENU) {
    control.menu = enumerate_menu(device, query);
  }
  return control;
}

}  // namespace

bool FormatEntry::offers(int width, int height, double fps) const {
  if (sizes.empty()) return true;
  return std::any_of(sizes.begin(), sizes.end(), [&](const FrameSizeEntry& size) {
    const bool fits =
        width >= size.width && width <= size.max_width && height >= size.height && height <= size.max_height;
    return fits && (fps <= 0 || size.fps.empty() || size.fps.front() >= 0.9 * fps);
  });
}

std::vector<FormatEntry> enumerate_formats(const V4l2Device& device) {
  std::vector<FormatEntry> formats;
  for (std::uint32_t i = 0; i < kLongestList; ++i) {
    v4l2_fmtdesc entry{};
    entry.index = i;
    entry.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    if (device.calls().ioctl(device.fd(), VIDIOC_ENUM_FMT, &entry) < 0) break;
    FormatEntry format{
        entry.pixelformat, text_of(entry.description), pixel_format_from_fourcc(entry.pixelformat), {}};
    enumerate_sizes(device, &format);
    formats.push_back(std::move(format));
  }
  return formats;
}

std::vector<ControlEntry> enumerate_controls(const V4l2Device& device) {
  std::vector<ControlEntry> controls;
  v4l2_queryctrl query{};
  std::uint32_t last = 0;
  for (std::uint32_t i = 0; i < kLongestList; ++i) {
    query.id = last | V4L2_CTRL_FLAG_NEXT_CTRL;
    if (device.calls().ioctl(device.fd(), VIDIOC_QUERYCTRL, &query) < 0 || query.id <= last) break;
    last = query.id;
    const bool usable = query.type != V4L2_CTRL_TYPE_CTRL_CLASS && query.type != V4L2_CTRL_TYPE_BUTTON &&
                        (query.flags & V4L2_CTRL_FLAG_DISABLED) == 0;
    if (usable) controls.push_back(read_control(device, query));
  }
  return controls;
}

}  // namespace twofold
