#include "io/v4l2/camera.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace twofold {
namespace {

constexpr int kPollSliceMs = 100;  // how soon a stop request is seen
constexpr std::int64_t kMsNs = 1'000'000;
constexpr std::size_t kMostEvents = 100;

}  // namespace

std::string CameraOptions::invalid_reason() const {
  if (path.empty()) return "path must not be empty";
  if (buffers < 2 || buffers > 32) return fmt::format("buffers must be in 2..32, is {}", buffers);
  if (stall_timeout_ms <= 0) return fmt::format("stall_timeout_ms must be positive, is {}", stall_timeout_ms);
  if (reconnect_ms < 0) return fmt::format("reconnect_ms must not be negative, is {}", reconnect_ms);
  if ((format.width > 0) != (format.height > 0)) return "width and height go together";
  return {};
}

V4l2Expected<std::unique_ptr<V4l2Camera>> V4l2Camera::open(V4l2Calls& calls, CameraOptions options) {
  std::unique_ptr<V4l2Camera> camera(new V4l2Camera(calls, std::move(options)));
  if (auto started = camera->start(); !started) return tl::unexpected(started.error());
  camera->identity_ = camera->device_->identity();
  return camera;
}

/// Opens the device and starts a stream. After the first time it must be the same kind of camera in the same
/// format, because what comes after is set up for that.
V4l2Expected<void> V4l2Camera::start() {
  const bool first = identity_.card.empty() && identity_.driver.empty();
  auto device = V4l2Device::open(calls_, options_.path);
  if (!device) return tl::unexpected(device.error());
  if (!first && !device->identity().same_model(identity_)) {
    return tl::unexpected(V4l2Error{
        0, fmt::format("is now another camera ({}, was {})", device->identity().card, identity_.card)});
  }
  device_.emplace(std::move(*device));
  const auto format = device_->negotiate(options_.format);
  if (!format) return tl::unexpected(format.error());
  if (!first &&
      (format->layout.width != format_.layout.width || format->layout.height != format_.layout.height ||
       format->layout.format != format_.layout.format)) {
    return tl::unexpected(V4l2Error{0, "came back with another format"});
  }
  format_ = *format;
  if (auto applied = device_->apply(options_.settings); !applied) return applied;
  auto stream = V4l2Stream::start(*device_, format_.layout, options_.buffers);
  if (!stream) return tl::unexpected(stream.error());
  stream_ = std::move(*stream);
  last_sign_ns_ = calls_.now_ns();
  // From now on the same format is asked for, also where it was chosen here.
  options_.format.format = format_.layout.format;
  options_.format.width = format_.layout.width;
  options_.format.height = format_.layout.height;
  return {};
}

void V4l2Camera::close() {
  stream_.reset();
  device_.reset();
}

void V4l2Camera::note(const std::string& event) {
  last_fault_ = event;
  if (report_.events.size() < kMostEvents) {
    report_.events.push_back(fmt::format("frame {}: {}", report_.frames + report_.lost(), event));
  }
}

bool V4l2Camera::give_up(const std::string& why) {
  const std::int64_t silent_ns = calls_.now_ns() - waiting_since_ns_;
  if (silent_ns < std::int64_t{options_.reconnect_ms + options_.stall_timeout_ms} * kMsNs) return false;
  close();
  problem_ = fmt::format("no frame for {:.1f} s: {}", static_cast<double>(silent_ns) * 1e-9, why);
  return true;
}

CameraStatus V4l2Camera::reopen(const std::atomic<bool>& stop) {
  close();
  constexpr int kRetryMs = 100;
  if (std::exchange(restarted_, true)) calls_.sleep_ms(kRetryMs);  // the last new start led nowhere
  // Relaxed: the flag carries no other data.
  while (!stop.load(std::memory_order_relaxed)) {
    auto started = start();
    if (started) {
      ++report_.restarts;
      return CameraStatus::kFrame;
    }
    close();
    // The fault that led here is the cause; that the node is missing meanwhile tells nothing new.
    if (give_up(started.error().is_absence() ? last_fault_ : started.error().text))
      return CameraStatus::kLost;
    calls_.sleep_ms(kRetryMs);
  }
  return CameraStatus::kStopped;
}

CameraStatus V4l2Camera::next(const std::atomic<bool>& stop, CameraFrame* frame) {
  // Counts from here: that the caller took its time is no fault of the camera. Frames that could not be
  // decoded are as good as none, and do not start the count anew.
  if (std::exchange(undecodable_, false)) {
    if (give_up(last_fault_)) return CameraStatus::kLost;
  } else {
    waiting_since_ns_ = calls_.now_ns();
  }
  // Relaxed: the flag carries no other data.
  while (!stop.load(std::memory_order_relaxed)) {
    if (!problem_.empty()) return CameraStatus::kLost;
    if (!stream_) {
      if (const CameraStatus status = reopen(stop); status != CameraStatus::kFrame) return status;
    }
    const StreamFrame answer = stream_->wait(std::min(kPollSliceMs, options_.stall_timeout_ms));
    const std::int64_t now_ns = calls_.now_ns();
    switch (answer.status) {
      case StreamStatus::kFrame:
      case StreamStatus::kDamaged:
        last_sign_ns_ = now_ns;
        if (accept(answer, frame)) return CameraStatus::kFrame;
        break;
      case StreamStatus::kTimeout:
        if (now_ns - last_sign_ns_ >= std::int64_t{options_.stall_timeout_ms} * kMsNs) {
          note(fmt::format("no frame for {} ms", options_.stall_timeout_ms));
          close();
        }
        break;
      case StreamStatus::kFailed:
      case StreamStatus::kGone:
        note(answer.problem);
        close();
        break;
    }
    if (give_up(last_fault_)) return CameraStatus::kLost;
  }
  return CameraStatus::kStopped;
}

/// Frames' worth of time between the last frame and this one, after a restart: sequence numbers began anew.
void V4l2Camera::count_missed(std::int64_t t_ns) {
  if (!std::exchange(restarted_, false) || !last_t_ns_ || format_.fps <= 0) return;
  const double intervals = static_cast<double>(t_ns - *last_t_ns_) * 1e-9 * format_.fps;
  report_.missed_in_restarts += static_cast<std::uint64_t>(std::max(0.0, std::round(intervals) - 1));
}

bool V4l2Camera::accept(const StreamFrame& answer, CameraFrame* frame) {
  if (answer.lost > 0) {
    note(fmt::format("{} dropped before it", answer.lost));
    report_.dropped += answer.lost;
  }
  if (answer.stamped_on_arrival && !report_.stamped_on_arrival) {
    report_.stamped_on_arrival = true;
    note("the driver's time stamps cannot be used: frames are stamped on arrival");
  }
  if (answer.status == StreamStatus::kDamaged) {
    note(answer.problem);
    ++report_.damaged;
    return false;
  }
  if (last_t_ns_ && answer.t_ns <= *last_t_ns_) {
    note("the time stamp does not move forward");
    ++report_.damaged;
    return false;
  }
  count_missed(answer.t_ns);
  last_t_ns_ = answer.t_ns;
  *frame = {answer.image, answer.t_ns, report_.frames + report_.lost()};
  ++report_.frames;
  return true;
}

void V4l2Camera::report_damaged(const std::string& problem) {
  undecodable_ = true;
  --report_.frames;
  note(problem);
  ++report_.damaged;
}

}  // namespace twofold
