// Captures from a kernel device and judges what came. Runs inside a virtual machine (virtual_machine.sh), so
// it needs nothing but the C++ library, and is built for any x86-64 processor.
//
//   capture_check DEVICE formats FRAMES NAME...  every supported format the device lists; those named must be
//                                              among them
//   capture_check DEVICE fault FRAMES WHAT     one format; WHAT must have been counted and survived:
//                                              dropped, damaged, restarts
//   capture_check DEVICE lost                  the device must be given up cleanly
//   capture_check DEVICE refused               opening it must fail with a reason
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "io/v4l2/camera.hpp"
#include "io/v4l2/enumeration.hpp"

namespace {

using namespace twofold;  // a program, not a header

struct Capture {
  std::uint64_t frames = 0;
  std::uint64_t index_span = 0;
  double seconds = 0;
  bool ordered = true;
  bool sizes = true;
  bool converted = true;
  CameraStatus last = CameraStatus::kFrame;
};

Capture capture(V4l2Camera& camera, std::uint64_t wanted) {
  Capture result;
  const std::atomic<bool> never{false};
  const ImageLayout& layout = camera.format().layout;
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(layout.width) *
                                 static_cast<std::size_t>(layout.height));
  CameraFrame first, before, frame;
  while (result.frames < wanted && (result.last = camera.next(never, &frame)) == CameraStatus::kFrame) {
    if (result.frames == 0) first = before = frame;
    if (result.frames > 0 && (frame.t_ns <= before.t_ns || frame.index <= before.index))
      result.ordered = false;
    if (frame.image.size() < layout.min_bytes()) result.sizes = false;
    if (layout.format != PixelFormat::kZ16 &&
        !to_grey(layout, frame.image, grey.data(), static_cast<std::size_t>(layout.width))) {
      result.converted = false;
    }
    before = frame;
    ++result.frames;
  }
  result.index_span = before.index - first.index;
  result.seconds = static_cast<double>(before.t_ns - first.t_ns) * 1e-9;
  return result;
}

/// Frames counted by number and by the time that went by, two clocks for the same thing, agree.
bool gaps_exact(const Capture& result, double fps, std::uint64_t restarts) {
  const double by_time = result.seconds * fps;
  return fps <= 0 || std::abs(by_time - static_cast<double>(result.index_span)) <
                         1.5 + 1.5 * static_cast<double>(restarts);
}

void print_events(const V4l2Camera& camera) {
  for (const std::string& event : camera.report().events) std::printf("    %s\n", event.c_str());
}

/// True when everything that must hold for an undisturbed stream holds.
bool check_format(V4l2Calls& calls, const std::string& path, PixelFormat format, int width, int height,
                  std::uint64_t frames) {
  CameraOptions options;
  options.path = path;
  options.format = {format, width, height, 30};
  auto camera = V4l2Camera::open(calls, options);
  if (!camera) {
    std::printf("FAILED %s: %s\n", name(format), camera.error().text.c_str());
    return false;
  }
  const Capture result = capture(**camera, frames);
  const CameraReport& report = (*camera)->report();
  const double fps = (*camera)->format().fps;
  const bool passed = result.frames == frames && result.ordered && result.sizes && result.converted &&
                      gaps_exact(result, fps, 0) && report.restarts == 0 && report.damaged == 0;
  std::printf(
      "%s %-4s %dx%d %.2f fps: %llu frames in %.2f s, %llu dropped, span %.2f frames by time, %llu by "
      "number\n",
      passed ? "passed" : "FAILED", name(format), width, height, fps,
      static_cast<unsigned long long>(result.frames), result.seconds,
      static_cast<unsigned long long>(report.dropped), result.seconds * fps,
      static_cast<unsigned long long>(result.index_span));
  if (!passed) print_events(**camera);
  return passed;
}

int check_formats(V4l2Calls& calls, const std::string& path, std::uint64_t frames,
                  const std::vector<std::string>& expected) {
  std::vector<PixelFormat> formats;
  {
    const auto device = V4l2Device::open(calls, path);
    if (!device) {
      std::printf("FAILED: %s\n", device.error().text.c_str());
      return 1;
    }
    const auto entries = enumerate_formats(*device);
    for (const FormatEntry& entry : entries) {
      if (entry.format && entry.offers(640, 480, 0)) formats.push_back(*entry.format);
    }
    std::printf("%s: %zu formats, %zu of them supported at 640x480, %zu controls\n",
                device->identity().card.c_str(), entries.size(), formats.size(),
                enumerate_controls(*device).size());
  }
  bool passed = !formats.empty();
  for (const std::string& format : expected) {
    if (std::none_of(formats.begin(), formats.end(), [&](PixelFormat f) { return format == name(f); })) {
      std::printf("FAILED: %s is not among them\n", format.c_str());
      passed = false;
    }
  }
  for (const PixelFormat format : formats) passed &= check_format(calls, path, format, 640, 480, frames);
  return passed ? 0 : 1;
}

int check_fault(V4l2Calls& calls, const std::string& path, std::uint64_t frames, const std::string& what) {
  CameraOptions options;
  options.path = path;
  options.format = {PixelFormat::kYuyv, 640, 480, 30};
  auto camera = V4l2Camera::open(calls, options);
  if (!camera) {
    std::printf("FAILED: %s\n", camera.error().text.c_str());
    return 1;
  }
  const Capture result = capture(**camera, frames);
  const CameraReport& report = (*camera)->report();
  const std::uint64_t counted = what == "dropped"    ? report.dropped
                                : what == "damaged"  ? report.damaged
                                : what == "restarts" ? report.restarts
                                                     : 1;
  const bool passed = result.frames == frames && result.ordered && result.sizes && result.converted &&
                      counted > 0 && gaps_exact(result, (*camera)->format().fps, report.restarts);
  std::printf("%s %s: %llu frames, %llu dropped, %llu damaged, %llu restarts, %llu missed meanwhile\n",
              passed ? "passed" : "FAILED", what.c_str(), static_cast<unsigned long long>(result.frames),
              static_cast<unsigned long long>(report.dropped),
              static_cast<unsigned long long>(report.damaged),
              static_cast<unsigned long long>(report.restarts),
              static_cast<unsigned long long>(report.missed_in_restarts));
  print_events(**camera);
  return passed ? 0 : 1;
}

int check_refused(V4l2Calls& calls, const std::string& path) {
  CameraOptions options;
  options.path = path;
  options.format = {PixelFormat::kYuyv, 640, 480, 30};
  const auto camera = V4l2Camera::open(calls, options);
  if (camera) {
    std::printf("FAILED: it was opened\n");
    return 1;
  }
  std::printf("passed refused: %s\n", camera.error().text.c_str());
  return camera.error().text.empty() ? 1 : 0;
}

int check_lost(V4l2Calls& calls, const std::string& path) {
  CameraOptions options;
  options.path = path;
  options.format = {PixelFormat::kYuyv, 640, 480, 30};
  options.reconnect_ms = 2000;
  auto camera = V4l2Camera::open(calls, options);
  if (!camera) {
    std::printf("FAILED: %s\n", camera.error().text.c_str());
    return 1;
  }
  const Capture result = capture(**camera, 1'000'000);
  const bool passed = result.last == CameraStatus::kLost && result.frames > 0;
  std::printf("%s lost: after %llu frames: %s\n", passed ? "passed" : "FAILED",
              static_cast<unsigned long long>(result.frames), (*camera)->problem().c_str());
  return passed ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const std::string path = argc > 1 ? argv[1] : "";
  const std::string mode = argc > 2 ? argv[2] : "";
  twofold::SystemV4l2Calls calls;
  if (mode == "formats" && argc >= 4)
    return check_formats(calls, path, std::strtoull(argv[3], nullptr, 10), {argv + 4, argv + argc});
  if (mode == "fault" && argc == 5)
    return check_fault(calls, path, std::strtoull(argv[3], nullptr, 10), argv[4]);
  if (mode == "lost" && argc == 3) return check_lost(calls, path);
  if (mode == "refused" && argc == 3) return check_refused(calls, path);
  std::fprintf(stderr,
               "usage: capture_check DEVICE formats FRAMES NAME... | fault FRAMES WHAT | lost | refused\n");
  return 2;
}
