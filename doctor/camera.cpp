#include "doctor/camera.hpp"

#include <algorithm>
#include <fstream>

#include <fmt/format.h>

#include "io/v4l2/enumeration.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

/// What video can have of a bus of so many Mbit/s [bytes/s]. USB 2: three packets of 1024 bytes in each of
/// 8000 micro-frames is all an isochronous endpoint gets; USB 1: 1023 bytes a millisecond; beyond: 80 % of
/// what is left after 8b/10b or 128b/132b coding.
double usable_bytes_per_second(double mbit) {
  if (mbit <= 12) return 1023e3;
  if (mbit <= 480) return 3 * 1024 * 8000;
  return 0.8 * mbit * 1e6 / (mbit <= 5000 ? 10 : 8.25);
}

/// Mbit/s of the USB device above a video node; nothing for other buses.
std::optional<double> usb_speed(const fs::path& root, const std::string& device) {
  std::error_code error;
  const fs::path link = root / "sys/class/video4linux" / fs::path(device).filename() / "device";
  for (fs::path folder = fs::canonical(link, error); !error && folder.has_relative_path();
       folder = folder.parent_path()) {
    std::ifstream in(folder / "speed");
    if (double speed = 0; in >> speed && speed > 0) return speed;
    if (folder == folder.parent_path()) break;
  }
  return std::nullopt;
}

/// The cheapest of the formats that are offered and meant.
std::optional<PixelFormat> chosen_format(const std::vector<FormatEntry>& offered,
                                         const CaptureFormat& wanted) {
  for (const PixelFormat format : pixel_formats()) {
    if (wanted.format ? *wanted.format != format : format == PixelFormat::kZ16) continue;
    for (const FormatEntry& entry : offered) {
      if (entry.format == format && entry.offers(wanted.width, wanted.height, wanted.fps)) return format;
    }
  }
  return std::nullopt;
}

Finding check_bus(const fs::path& root, const std::string& device, PixelFormat format,
                  const CaptureFormat& wanted) {
  const auto speed = usb_speed(root, device);
  if (!speed) return {Health::kOk, device + " bus", "not USB", ""};
  const double needed = stream_bytes_per_second(format, wanted.width, wanted.height, wanted.fps);
  const double usable = usable_bytes_per_second(*speed);
  const std::string state =
      fmt::format("USB at {:g} Mbit/s carries {:.1f} MB/s, {} at this size and rate needs {:.1f}", *speed,
                  1e-6 * usable, name(format), 1e-6 * needed);
  if (needed <= 0.7 * usable) return {Health::kOk, device + " bus", state, ""};
  const std::string remedy = *speed < 5000 ? "a USB 3 port and cable, format=MJPG, a smaller size or rate"
                                           : "a smaller size or rate, or one controller a camera";
  return {needed <= usable ? Health::kWarn : Health::kBad, device + " bus", state, remedy};
}

}  // namespace

double stream_bytes_per_second(PixelFormat format, int width, int height, double fps) {
  double bytes_per_pixel = 2;
  if (format == PixelFormat::kGrey) bytes_per_pixel = 1;
  if (format == PixelFormat::kNv12) bytes_per_pixel = 1.5;
  if (format == PixelFormat::kMjpg) bytes_per_pixel = 0.2;
  return bytes_per_pixel * width * height * fps;
}

std::vector<Finding> check_camera(V4l2Calls& calls, const fs::path& root, const std::string& device,
                                  const CaptureFormat& wanted) {
  const auto opened = V4l2Device::open(calls, device);
  if (!opened) {
    return {{Health::kBad, device, opened.error().text,
             "`twofold devices` lists cameras; reading them needs the group video"}};
  }
  const std::string what =
      fmt::format("{}{}x{} at {:g} fps", wanted.format ? std::string(name(*wanted.format)) + " " : "",
                  wanted.width, wanted.height, wanted.fps);
  const auto format = chosen_format(enumerate_formats(*opened), wanted);
  if (!format)
    return {{Health::kBad, device, "does not offer " + what, "choose from `twofold devices " + device + "`"}};
  return {{Health::kOk, device,
           fmt::format("{} offers {} ({})", opened->identity().card, what, name(*format)), ""},
          check_bus(root, device, *format, wanted)};
}

}  // namespace twofold
