#pragma once

#include <memory>

#include "camera/rectifier.hpp"
#include "io/sources/frame_source.hpp"

namespace twofold {

/// The frames of another source of one camera, rectified with a calibration that was found after it was
/// opened.
class CalibratedSource final : public FrameSource {
 public:
  /// @param calibration  of one camera, for images as `source` delivers them
  /// Throws std::runtime_error as Rectifier does.
  CalibratedSource(std::unique_ptr<FrameSource> source, const Calibration& calibration);

  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return source_->frame_count(); }
  [[nodiscard]] bool is_live() const override { return source_->is_live(); }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override;

 private:
  bool read(Frame& frame) override;

  std::unique_ptr<FrameSource> source_;
  Rectifier rectifier_;
};

}  // namespace twofold
