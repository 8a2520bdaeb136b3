#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "io/sources/frame_source.hpp"
#include "io/sources/source_parameters.hpp"
#include "io/v4l2/camera.hpp"
#include "io/v4l2/pairing.hpp"

namespace twofold {

/// What v4l2:DEVICE?... asks for.
struct V4l2FramesOptions {
  CameraOptions first;                  ///< left, only, or colour camera; or both in one stream
  std::optional<CameraOptions> second;  ///< right or depth camera
  bool side_by_side = false;            ///< the stream's left half is the left image
  bool depth = false;                   ///< second delivers Z16
  std::optional<double> pairing_tolerance_ms = std::nullopt;  ///< >= 0; default: half a frame interval

  [[nodiscard]] SensorKind kind() const;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Takes the parameters size=640x480, fps=, format=, layout=mono|side-by-side, right=DEVICE, depth=DEVICE,
/// pairing_ms=, exposure_us=, gain=, focus=, buffers=, stall_ms=, reconnect_ms=. Throws IoError.
[[nodiscard]] V4l2FramesOptions take_v4l2_options(const std::string& device, SourceParameters& parameters);

/// Cameras' images as grey and depth, before rectification: one camera, two in one stream, or two paired by
/// time.
class V4l2Frames {
 public:
  /// Throws IoError naming the device. `calls` outlives this.
  V4l2Frames(V4l2Calls& calls, V4l2FramesOptions options);

  enum class Status : std::uint8_t { kFrame, kStopped };
  /// Waits for the next frame; its images may lie in the driver's memory and are valid until the next call
  /// only. Throws IoError when a camera is lost for good.
  [[nodiscard]] Status next(const std::atomic<bool>& stop, Frame* raw);

  /// Size of one image [px].
  [[nodiscard]] int width() const;
  [[nodiscard]] int height() const;
  [[nodiscard]] double fps() const { return first_->format().fps; }
  [[nodiscard]] SensorKind kind() const { return options_.kind(); }
  [[nodiscard]] SourceReport report() const;

 private:
  struct Shot {
    CameraFrame frame;
    bool held = false;  // frame has not been delivered or dropped
  };
  [[nodiscard]] std::unique_ptr<V4l2Camera> open(const CameraOptions& options) const;
  [[nodiscard]] bool fetch(V4l2Camera& camera, const std::string& path, const std::atomic<bool>& stop,
                           Shot* shot);
  [[nodiscard]] bool fetch_pair(const std::atomic<bool>& stop);
  /// False: the frame was damaged and is counted as such.
  [[nodiscard]] static bool grey(V4l2Camera& camera, const CameraFrame& frame, cv::Mat* image);
  [[nodiscard]] bool convert(Frame* raw);

  V4l2Calls& calls_;
  V4l2FramesOptions options_;
  std::unique_ptr<V4l2Camera> first_;
  std::unique_ptr<V4l2Camera> second_;
  std::optional<FramePairer> pairer_;
  Shot first_shot_, second_shot_;
  std::uint64_t spoilt_pairs_ = 0;  // paired, but the second image could not be decoded
};

}  // namespace twofold
