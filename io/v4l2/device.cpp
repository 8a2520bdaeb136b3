#include "io/v4l2/device.hpp"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "io/v4l2/enumeration.hpp"

namespace twofold {
namespace {

constexpr int kLargestSide = 16384;

template <std::size_t kSize>
std::string text_of(const std::uint8_t (&field)[kSize]) {
  const auto* begin = reinterpret_cast<const char*>(field);
  std::string text(begin, strnlen(begin, kSize));  // the terminator may be missing
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ' || c == 0x7f) c = '?';
  }
  return text;
}

V4l2Error open_error(int result) {
  V4l2Error error = call_error("cannot be opened", result);
  if (result == -EACCES) error.text += " (is the user in the group 'video'?)";
  if (result == -EBUSY) error.text += " (another program uses it)";
  return error;
}

/// Row stride of the negotiated format; drivers that leave it 0 mean rows without padding.
V4l2Expected<ImageLayout> checked_layout(const v4l2_pix_format& answer, PixelFormat format) {
  if (answer.width < 2 || answer.height < 2 || answer.width > kLargestSide || answer.height > kLargestSide) {
    return tl::unexpected(V4l2Error{0, fmt::format("offers images of {}x{}", answer.width, answer.height)});
  }
  ImageLayout layout{format, static_cast<int>(answer.width), static_cast<int>(answer.height),
                     answer.bytesperline};
  if (layout.stride == 0) layout.stride = layout.row_bytes();
  constexpr std::size_t kWidestStride = std::size_t{kLargestSide} * 4;
  if (layout.stride < layout.row_bytes() || layout.stride > kWidestStride) {
    return tl::unexpected(V4l2Error{
        0, fmt::format("says that rows of {} bytes lie {} bytes apart", layout.row_bytes(), layout.stride)});
  }
  return layout;
}

}  // namespace

bool V4l2Error::is_absence() const {
  return code == ENODEV || code == ENOENT || code == ENXIO;
}

V4l2Error call_error(const std::string& what, int negative_errno) {
  return {-negative_errno, fmt::format("{}: {}", what, std::strerror(-negative_errno))};
}

V4l2Expected<V4l2Device> V4l2Device::open(V4l2Calls& calls, const std::string& path) {
  const int fd = calls.open(path.c_str());
  if (fd < 0) return tl::unexpected(open_error(fd));
  V4l2Device device(calls, fd);
  if (auto identified = device.identify(); !identified) return tl::unexpected(identified.error());
  return device;
}

V4l2Device::V4l2Device(V4l2Device&& other) noexcept
    : calls_(other.calls_), fd_(std::exchange(other.fd_, -1)), identity_(std::move(other.identity_)) {}

V4l2Device::~V4l2Device() {
  if (fd_ >= 0) calls_->close(fd_);
}

V4l2Expected<void> V4l2Device::identify() {
  v4l2_capability answer{};
  if (const int result = calls_->ioctl(fd_, VIDIOC_QUERYCAP, &answer); result < 0) {
    return tl::unexpected(result == -ENOTTY ? V4l2Error{ENOTTY, "is not a video device"}
                                            : call_error("QUERYCAP", result));
  }
  identity_ = {text_of(answer.card), text_of(answer.driver), text_of(answer.bus_info)};
  const bool per_node = (answer.capabilities & V4L2_CAP_DEVICE_CAPS) != 0;
  const std::uint32_t able = per_node ? answer.device_caps : answer.capabilities;
  const auto refuse = [&](const char* why) {
    return tl::unexpected(V4l2Error{0, fmt::format("({}) {}", identity_.card, why)});
  };
  if ((able & V4L2_CAP_VIDEO_CAPTURE) == 0) {
    if ((able & (V4L2_CAP_VIDEO_CAPTURE_MPLANE | V4L2_CAP_VIDEO_M2M_MPLANE)) != 0) {
      return refuse("has the multi-planar interface only, which is not supported");
    }
    return refuse("captures no video: another node of the same device may");
  }
  if ((able & V4L2_CAP_STREAMING) == 0) return refuse("does not stream");
  return {};
}

V4l2Expected<PixelFormat> V4l2Device::choose_format(const CaptureFormat& wanted) {
  const std::vector<FormatEntry> offered = enumerate_formats(*this);
  const auto offers = [&](PixelFormat format, bool at_rate) {
    for (const FormatEntry& entry : offered) {
      if (entry.format == format && entry.offers(wanted.width, wanted.height, at_rate ? wanted.fps : 0))
        return true;
    }
    return false;
  };
  for (const bool at_rate : {true, false}) {
    for (const PixelFormat format : pixel_formats()) {
      if (format != PixelFormat::kZ16 && offers(format, at_rate)) return format;
    }
  }
  std::string names;
  for (const FormatEntry& entry : offered) names += fmt::format(" {}", fourcc_text(entry.fourcc));
  return tl::unexpected(V4l2Error{0, fmt::format("offers no supported format at {}x{} (its formats:{})",
                                                 wanted.width, wanted.height, names)});
}

V4l2Expected<NegotiatedFormat> V4l2Device::negotiate(const CaptureFormat& wanted_by_user) {
  CaptureFormat wanted = wanted_by_user;
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (const int result = calls_->ioctl(fd_, VIDIOC_G_FMT, &format); result < 0) {
    return tl::unexpected(call_error("G_FMT", result));
  }
  v4l2_pix_format& pixels = format.fmt.pix;
  if (wanted.width == 0) {
    wanted.width = static_cast<int>(std::min<std::uint32_t>(pixels.width, kLargestSide));
    wanted.height = static_cast<int>(std::min<std::uint32_t>(pixels.height, kLargestSide));
  }
  if (!wanted.format) {
    const auto chosen = choose_format(wanted);
    if (!chosen) return tl::unexpected(chosen.error());
    wanted.format = *chosen;
  }
  pixels.width = static_cast<std::uint32_t>(wanted.width);
  pixels.height = static_cast<std::uint32_t>(wanted.height);
  pixels.pixelformat = fourcc(*wanted.format);
  pixels.field = V4L2_FIELD_NONE;
  pixels.bytesperline = 0;
  pixels.sizeimage = 0;
  if (const int result = calls_->ioctl(fd_, VIDIOC_S_FMT, &format); result < 0) {
    return tl::unexpected(call_error("S_FMT", result));
  }
  if (pixel_format_from_fourcc(pixels.pixelformat) != wanted.format ||
      pixels.width != static_cast<std::uint32_t>(wanted.width) ||
      pixels.height != static_cast<std::uint32_t>(wanted.height)) {
    return tl::unexpected(V4l2Error{
        0, fmt::format("gives {} {}x{} when asked for {} {}x{}", fourcc_text(pixels.pixelformat),
                       pixels.width, pixels.height, name(*wanted.format), wanted.width, wanted.height)});
  }
  const auto layout = checked_layout(pixels, *wanted.format);
  if (!layout) return tl::unexpected(layout.error());
  return NegotiatedFormat{*layout, set_rate(wanted.fps)};
}

/// A device without a rate to set (a signal on HDMI) is fine: the rate is a wish.
double V4l2Device::set_rate(double fps) {
  v4l2_streamparm parameters{};
  parameters.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  if (calls_->ioctl(fd_, VIDIOC_G_PARM, &parameters) < 0) return 0;
  v4l2_captureparm& capture = parameters.parm.capture;
  if (fps > 0 && (capture.capability & V4L2_CAP_TIMEPERFRAME) != 0) {
    capture.timeperframe.numerator = 1000;
    capture.timeperframe.denominator = static_cast<std::uint32_t>(std::lround(std::min(fps, 1e5) * 1000));
    if (calls_->ioctl(fd_, VIDIOC_S_PARM, &parameters) < 0) return 0;
  }
  const v4l2_fract& interval = capture.timeperframe;
  return interval.numerator == 0 ? 0 : static_cast<double>(interval.denominator) / interval.numerator;
}

V4l2Expected<void> V4l2Device::set_control(std::uint32_t id, const char* name, std::int64_t value) {
  v4l2_queryctrl query{};
  query.id = id;
  if (calls_->ioctl(fd_, VIDIOC_QUERYCTRL, &query) < 0 || (query.flags & V4L2_CTRL_FLAG_DISABLED) != 0) {
    return tl::unexpected(V4l2Error{0, fmt::format("has no control for {}", name)});
  }
  if (value < query.minimum || value > query.maximum) {
    return tl::unexpected(
        V4l2Error{0, fmt::format("{} must be in {}..{}, is {}", name, query.minimum, query.maximum, value)});
  }
  v4l2_control control{id, static_cast<std::int32_t>(value)};
  if (const int result = calls_->ioctl(fd_, VIDIOC_S_CTRL, &control); result < 0) {
    return tl::unexpected(call_error(fmt::format("setting {} to {}", name, value), result));
  }
  return {};
}

void V4l2Device::set_if_present(std::uint32_t id, std::int32_t value) {
  v4l2_control control{id, value};
  [[maybe_unused]] const int result = calls_->ioctl(fd_, VIDIOC_S_CTRL, &control);  // absent on most cameras
}

V4l2Expected<void> V4l2Device::apply(const CameraSettings& settings) {
  V4l2Expected<void> done;
  if (settings.exposure_us) {
    set_if_present(V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL);
    set_if_present(V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0);  // or the rate falls in the dark
    constexpr double kUnitUs = 100;
    done = set_control(V4L2_CID_EXPOSURE_ABSOLUTE, "exposure [100 us]",
                       std::llround(*settings.exposure_us / kUnitUs));
  }
  if (done && settings.gain) {
    set_if_present(V4L2_CID_AUTOGAIN, 0);
    done = set_control(V4L2_CID_GAIN, "gain", *settings.gain);
  }
  if (done && settings.focus) {
    set_if_present(V4L2_CID_FOCUS_AUTO, 0);
    done = set_control(V4L2_CID_FOCUS_ABSOLUTE, "focus", *settings.focus);
  }
  return done;
}

}  // namespace twofold
