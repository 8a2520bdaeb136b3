#include "io/sources/v4l2_frames.hpp"

#include <cmath>
#include <cstdio>

#include <fmt/format.h>

#include "base/option_check.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

int take_integer(SourceParameters& parameters, const char* key, int fallback) {
  const auto value = parameters.take_number(key);
  if (!value) return fallback;
  if (*value != std::floor(*value) || std::abs(*value) > 1e9) {
    throw IoError(parameters.subject(), fmt::format("{}={} must be a whole number", key, *value));
  }
  return static_cast<int>(*value);
}

CaptureFormat take_format(SourceParameters& parameters) {
  CaptureFormat format;
  if (const auto size = parameters.take_text("size")) {
    int used = 0;
    if (std::sscanf(size->c_str(), "%5dx%5d%n", &format.width, &format.height, &used) != 2 ||
        used != static_cast<int>(size->size()) || format.width < 2 || format.height < 2) {
      throw IoError(parameters.subject(), fmt::format("size='{}' is not WIDTHxHEIGHT", *size));
    }
  }
  if (const auto fps = parameters.take_number("fps")) {
    if (*fps <= 0) throw IoError(parameters.subject(), fmt::format("fps={} must be positive", *fps));
    format.fps = *fps;
  }
  if (const auto text = parameters.take_text("format")) {
    format.format = pixel_format_from_name(*text);
    if (!format.format || *format.format == PixelFormat::kZ16) {
      throw IoError(parameters.subject(),
                    fmt::format("format='{}' is none of GREY NV12 YUYV UYVY Y16 MJPG", *text));
    }
  }
  return format;
}

CameraSettings take_settings(SourceParameters& parameters) {
  CameraSettings settings;
  settings.exposure_us = parameters.take_number("exposure_us");
  if (const auto gain = parameters.take_number("gain")) settings.gain = static_cast<int>(std::lround(*gain));
  if (const auto focus = parameters.take_number("focus"))
    settings.focus = static_cast<int>(std::lround(*focus));
  return settings;
}

std::string percent(std::uint64_t part, std::uint64_t rest) {
  const double whole = static_cast<double>(part + rest);
  return fmt::format("{:.2f} %", whole > 0 ? 100 * static_cast<double>(part) / whole : 0);
}

void add_camera(const std::string& path, const CameraReport& camera, SourceReport* report) {
  report->summary.push_back(fmt::format(
      "{}: {} frames, {} lost ({}): {} dropped before they came, {} damaged, {} during {} restarts", path,
      camera.frames, camera.lost(), percent(camera.lost(), camera.frames), camera.dropped, camera.damaged,
      camera.missed_in_restarts, camera.restarts));
  for (const std::string& event : camera.events) report->faults.push_back(path + ": " + event);
}

}  // namespace

SensorKind V4l2FramesOptions::kind() const {
  if (side_by_side) return SensorKind::kStereo;
  if (!second) return SensorKind::kMono;
  return depth ? SensorKind::kRgbd : SensorKind::kStereo;
}

V4l2FramesOptions take_v4l2_options(const std::string& device, SourceParameters& parameters) {
  V4l2FramesOptions options;
  CameraOptions& camera = options.first;
  camera.path = device;
  camera.format = take_format(parameters);
  camera.settings = take_settings(parameters);
  camera.buffers = take_integer(parameters, "buffers", camera.buffers);
  camera.stall_timeout_ms = take_integer(parameters, "stall_ms", camera.stall_timeout_ms);
  camera.reconnect_ms = take_integer(parameters, "reconnect_ms", camera.reconnect_ms);
  const auto layout = parameters.take_text("layout");
  if (layout && *layout != "mono" && *layout != "side-by-side") {
    throw IoError(parameters.subject(), fmt::format("layout='{}' is neither mono nor side-by-side", *layout));
  }
  options.side_by_side = layout && *layout == "side-by-side";
  const auto right = parameters.take_text("right");
  const auto depth = parameters.take_text("depth");
  if ((right || depth) && (options.side_by_side || (right && depth))) {
    throw IoError(parameters.subject(), "right=, depth= and layout=side-by-side exclude each other");
  }
  if (right || depth) {
    options.second = camera;
    options.second->path = right ? *right : *depth;
    options.depth = depth.has_value();
    if (options.depth) {
      options.second->format.format = PixelFormat::kZ16;
      options.second->settings = {};
    }
  }
  options.pairing_tolerance_ms = parameters.take_number("pairing_ms");
  if (const auto reason = options.invalid_reason(); !reason.empty()) {
    throw IoError(parameters.subject(), reason);
  }
  return options;
}

std::string V4l2FramesOptions::invalid_reason() const {
  OptionCheck check;
  check.nested("first", first.invalid_reason());
  if (second) check.nested("second", second->invalid_reason());
  if (pairing_tolerance_ms) check.at_least("pairing_tolerance_ms", *pairing_tolerance_ms, 0);
  return check.reason();
}

V4l2Frames::V4l2Frames(V4l2Calls& calls, V4l2FramesOptions options)
    : calls_(calls), options_(std::move(options)) {
  first_ = open(options_.first);
  if (options_.side_by_side && first_->format().layout.width % 2 != 0) {
    throw IoError(options_.first.path, "cannot be two images side by side: the width is odd");
  }
  if (!options_.second) return;
  if (options_.first.format.width == 0) {  // two cameras of one rig: same size
    options_.second->format.width = width();
    options_.second->format.height = height();
  }
  second_ = open(*options_.second);
  double tolerance_ms = 500.0 / (fps() > 0 ? fps() : 30.0);
  if (options_.pairing_tolerance_ms) tolerance_ms = *options_.pairing_tolerance_ms;
  pairer_.emplace(std::llround(tolerance_ms * 1e6));
}

std::unique_ptr<V4l2Camera> V4l2Frames::open(const CameraOptions& options) const {
  auto camera = V4l2Camera::open(calls_, options);
  if (!camera) throw IoError(options.path, camera.error().text);
  return std::move(*camera);
}

int V4l2Frames::width() const {
  return first_->format().layout.width / (options_.side_by_side ? 2 : 1);
}

int V4l2Frames::height() const {
  return first_->format().layout.height;
}

bool V4l2Frames::fetch(V4l2Camera& camera, const std::string& path, const std::atomic<bool>& stop,
                       Shot* shot) {
  if (shot->held) return true;
  switch (camera.next(stop, &shot->frame)) {
    case CameraStatus::kFrame:
      shot->held = true;
      return true;
    case CameraStatus::kStopped:
      return false;
    case CameraStatus::kLost:
      break;
  }
  throw IoError(path, camera.problem());
}

bool V4l2Frames::fetch_pair(const std::atomic<bool>& stop) {
  for (;;) {
    if (!fetch(*first_, options_.first.path, stop, &first_shot_)) return false;
    if (!second_) return true;
    if (!fetch(*second_, options_.second->path, stop, &second_shot_)) return false;
    switch (pairer_->step(first_shot_.frame.t_ns, second_shot_.frame.t_ns)) {
      case PairingStep::kPair:
        return true;
      case PairingStep::kAdvanceLeft:
        first_shot_.held = false;
        break;
      case PairingStep::kAdvanceRight:
        second_shot_.held = false;
        break;
    }
  }
}

bool V4l2Frames::grey(V4l2Camera& camera, const CameraFrame& frame, cv::Mat* image) {
  const ImageLayout& layout = camera.format().layout;
  if (const auto view = grey_in_place(layout, frame.image)) {
    // The Mat only reads; OpenCV has no view of constant data.
    *image =
        cv::Mat(layout.height, layout.width, CV_8UC1, const_cast<std::uint8_t*>(view->data), view->stride);
    return true;
  }
  image->create(layout.height, layout.width, CV_8UC1);
  const auto done = to_grey(layout, frame.image, image->data, image->step[0]);
  if (!done) camera.report_damaged(done.error());
  return done.has_value();
}

bool V4l2Frames::convert(Frame* raw) {
  cv::Mat image;
  if (!grey(*first_, first_shot_.frame, &image)) return false;
  raw->index = static_cast<std::int64_t>(first_shot_.frame.index);
  raw->t_ns = first_shot_.frame.t_ns;
  if (options_.side_by_side) {
    raw->left = image.colRange(0, width());
    raw->right = image.colRange(width(), 2 * width());
    return true;
  }
  raw->left = image;
  if (!second_) return true;
  if (!options_.depth) {
    const bool decoded = grey(*second_, second_shot_.frame, &raw->right);
    spoilt_pairs_ += decoded ? 0 : 1;
    return decoded;
  }
  const ImageLayout& layout = second_->format().layout;
  raw->depth.create(layout.height, layout.width, CV_16UC1);
  to_depth(layout, second_shot_.frame.image, raw->depth.ptr<std::uint16_t>(), raw->depth.step[0]);
  return true;
}

V4l2Frames::Status V4l2Frames::next(const std::atomic<bool>& stop, Frame* raw) {
  for (;;) {
    first_shot_.held = second_shot_.held = false;
    if (!fetch_pair(stop)) return Status::kStopped;
    *raw = Frame();
    if (convert(raw)) return Status::kFrame;
  }
}

SourceReport V4l2Frames::report() const {
  SourceReport report;
  report.lost = first_->report().lost();
  add_camera(options_.first.path, first_->report(), &report);
  if (second_) {
    add_camera(options_.second->path, second_->report(), &report);
    const PairingReport& pairing = pairer_->report();
    report.lost += pairing.left_alone + spoilt_pairs_;  // what the second camera lost shows in these
    report.summary.push_back(
        fmt::format("{} pairs, {} + {} frames without partner; stamps of a pair differ by {:.3f} ms (mean), "
                    "{:.3f} ms (most)",
                    pairing.pairs, pairing.left_alone, pairing.right_alone, pairing.mean_error_ms(),
                    static_cast<double>(pairing.max_error_ns) * 1e-6));
  }
  return report;
}

}  // namespace twofold
