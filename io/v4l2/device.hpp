#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tl/expected.hpp>

#include "io/v4l2/pixel_format.hpp"
#include "io/v4l2/system_calls.hpp"

namespace twofold {

/// What went wrong with a device.
struct V4l2Error {
  int code = 0;      ///< errno; 0 when the device answered, but with something that cannot be used
  std::string text;  ///< one line without the device's name

  /// The device is not there (any more), as opposed to one that misbehaves.
  [[nodiscard]] bool is_absence() const;
};
template <class T>
using V4l2Expected = tl::expected<T, V4l2Error>;

/// "WHAT: No such device" for a failed call.
[[nodiscard]] V4l2Error call_error(const std::string& what, int negative_errno);

struct DeviceIdentity {
  std::string card;  ///< name for people
  std::string driver;
  std::string bus;  ///< where it is plugged in

  /// Same kind of device; the bus may differ after it was plugged in elsewhere.
  [[nodiscard]] bool same_model(const DeviceIdentity& other) const {
    return card == other.card && driver == other.driver;
  }
};

/// What a person asks of a camera; what is left open is chosen here or left as the device has it.
struct CaptureFormat {
  std::optional<PixelFormat> format;
  int width = 0;  ///< [px]; 0 with height 0: as the device stands
  int height = 0;
  double fps = 0;  ///< 0: as the device stands
};

/// What the device agreed to.
struct NegotiatedFormat {
  ImageLayout layout;
  double fps = 0;  ///< 0 when the device does not say
};

/// Fixed settings; exposure, gain and focus turn the automatic off that would undo them.
struct CameraSettings {
  std::optional<double> exposure_us;
  std::optional<int> gain;   ///< in the device's units
  std::optional<int> focus;  ///< likewise
};

/// An open capture device. Nothing it answers is trusted further than it is checked here.
class V4l2Device {
 public:
  /// Opens and asks what it is. Errors: not there, no permission, busy, no camera (output, metadata node),
  /// multi-planar interface only, no streaming.
  [[nodiscard]] static V4l2Expected<V4l2Device> open(V4l2Calls& calls, const std::string& path);
  V4l2Device(V4l2Device&& other) noexcept;
  V4l2Device& operator=(V4l2Device&&) = delete;
  ~V4l2Device();

  [[nodiscard]] const DeviceIdentity& identity() const { return identity_; }
  [[nodiscard]] V4l2Calls& calls() const { return *calls_; }
  [[nodiscard]] int fd() const { return fd_; }

  /// Sets format, size and rate. Error when the device ends up with another format or size; a rate it does
  /// not offer is rounded by the device: see the result.
  [[nodiscard]] V4l2Expected<NegotiatedFormat> negotiate(const CaptureFormat& wanted);
  /// Error: a control is missing, or the value is out of its range.
  [[nodiscard]] V4l2Expected<void> apply(const CameraSettings& settings);

 private:
  V4l2Device(V4l2Calls& calls, int fd) : calls_(&calls), fd_(fd) {}
  [[nodiscard]] V4l2Expected<void> identify();
  [[nodiscard]] V4l2Expected<PixelFormat> choose_format(const CaptureFormat& wanted);
  [[nodiscard]] double set_rate(double fps);
  [[nodiscard]] V4l2Expected<void> set_control(std::uint32_t id, const char* name, std::int64_t value);
  void set_if_present(std::uint32_t id, std::int32_t value);

  V4l2Calls* calls_;
  int fd_;
  DeviceIdentity identity_;
};

}  // namespace twofold
