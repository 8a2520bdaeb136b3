#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "camera/rectifier.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/v4l2_frames.hpp"

namespace twofold {

/// Live cameras as a FrameSource: captured, paired, rectified.
///
/// With SourceOptions::raw images are copies of what the camera sees and need no calibration: rig() then
/// states kind and size only.
class V4l2Source final : public FrameSource {
 public:
  /// Throws IoError. calls: nullptr for the kernel's own.
  V4l2Source(const SourceSpec& spec, const SourceOptions& options,
             std::unique_ptr<V4l2Calls> calls = nullptr);

  [[nodiscard]] bool is_live() const override { return true; }
  [[nodiscard]] bool is_raw() const override { return !rectifier_.has_value(); }
  [[nodiscard]] SourceReport report() const override;

 private:
  V4l2Source(SourceParameters parameters, const SourceSpec& spec, const SourceOptions& options,
             std::unique_ptr<V4l2Calls> calls);
  bool read(Frame& frame) override;
  void set_up_calibration(SourceParameters& parameters, const SourceOptions& options);

  std::unique_ptr<V4l2Calls> calls_;
  std::string device_;
  V4l2Frames frames_;
  std::optional<Rectifier> rectifier_;
  std::atomic<bool> never_{false};
  const std::atomic<bool>* stop_;
};

}  // namespace twofold
