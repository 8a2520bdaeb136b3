#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/v4l2/device.hpp"
#include "io/v4l2/stream.hpp"

namespace twofold {

struct CameraOptions {
  std::string path;  ///< "/dev/video0", or a name under /dev/v4l/by-id that stays the same over a re-plug
  CaptureFormat format;
  CameraSettings settings;
  int buffers = 4;              ///< in the driver, in [2, 32]
  int stall_timeout_ms = 2000;  ///< a stream that is silent for so long is started anew, > 0
  int reconnect_ms = 10000;  ///< how long to wait for a camera that is gone or silent before giving up, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// What happened to a stream since it was opened.
struct CameraReport {
  std::uint64_t frames = 0;   ///< delivered
  std::uint64_t dropped = 0;  ///< missing by their sequence numbers
  std::uint64_t damaged =
      0;  ///< flagged, of wrong size, not decodable, or out of order: came, but not delivered
  std::uint64_t restarts = 0;            ///< stream or device opened again
  std::uint64_t missed_in_restarts = 0;  ///< frames' worth of time lost while it was, rounded
  bool stamped_on_arrival = false;       ///< at least one frame has no usable stamp of the driver's
  std::vector<std::string> events;       ///< the first 100 faults, one line each, in order of time

  /// Frames between the first and the last one that were not delivered.
  [[nodiscard]] std::uint64_t lost() const { return dropped + damaged + missed_in_restarts; }
};

enum class CameraStatus : std::uint8_t {
  kFrame,
  kStopped,  ///< asked to stop
  kLost      ///< the camera did not come back, or cannot be used any more; problem() says why
};

struct CameraFrame {
  std::span<const std::uint8_t> image;  ///< in the driver's memory, until the next call
  std::int64_t t_ns = 0;                ///< CLOCK_MONOTONIC, strictly increasing
  std::uint64_t index = 0;              ///< counts from 0; lost frames counted
};

/// A camera that survives what cameras do: faults of single frames are counted and skipped, a stream that
/// fails or falls silent is started anew, a camera that is unplugged is waited for. One thread.
class V4l2Camera {
 public:
  /// Opens, sets up and starts. Errors are final here: whoever starts a program wants to know at once.
  [[nodiscard]] static V4l2Expected<std::unique_ptr<V4l2Camera>> open(V4l2Calls& calls,
                                                                      CameraOptions options);

  [[nodiscard]] const DeviceIdentity& identity() const { return identity_; }
  [[nodiscard]] const NegotiatedFormat& format() const { return format_; }

  /// Waits for the next good frame. Returns within about 0.1 s of `stop`, and at the latest after
  /// reconnect_ms + stall_timeout_ms without one. After kLost further calls repeat it.
  [[nodiscard]] CameraStatus next(const std::atomic<bool>& stop, CameraFrame* frame);
  /// Tells the camera that the last frame turned out not to be decodable, so that it counts as damaged.
  void report_damaged(const std::string& problem);

  [[nodiscard]] const CameraReport& report() const { return report_; }
  [[nodiscard]] const std::string& problem() const { return problem_; }

 private:
  V4l2Camera(V4l2Calls& calls, CameraOptions options) : calls_(calls), options_(std::move(options)) {}
  [[nodiscard]] V4l2Expected<void> start();
  void close();
  [[nodiscard]] CameraStatus reopen(const std::atomic<bool>& stop);
  [[nodiscard]] bool accept(const StreamFrame& answer, CameraFrame* frame);
  [[nodiscard]] bool give_up(const std::string& why);
  void count_missed(std::int64_t t_ns);
  void note(const std::string& event);

  V4l2Calls& calls_;
  CameraOptions options_;
  DeviceIdentity identity_;
  NegotiatedFormat format_;
  std::optional<V4l2Device> device_;
  std::unique_ptr<V4l2Stream> stream_;  // after device_: ends first
  CameraReport report_;
  std::string problem_;
  std::string last_fault_;
  std::optional<std::int64_t> last_t_ns_;
  std::int64_t waiting_since_ns_ = 0;  // for a frame that can be used
  bool undecodable_ = false;           // the last delivered frame was
  std::int64_t last_sign_ns_ = 0;      // when the present stream last gave anything at all
  bool restarted_ = false;             // since the last delivered frame
};

}  // namespace twofold
