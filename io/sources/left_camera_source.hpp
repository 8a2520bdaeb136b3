#pragma once

#include <memory>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// The left camera of another source: what one camera alone would have seen. Right and depth images are
/// dropped.
class LeftCameraSource final : public FrameSource {
 public:
  explicit LeftCameraSource(std::unique_ptr<FrameSource> source);
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return source_->frame_count(); }
  [[nodiscard]] bool is_live() const override { return source_->is_live(); }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    return source_->colour_image(index);
  }

 private:
  bool read(Frame& frame) override;

  std::unique_ptr<FrameSource> source_;
};

}  // namespace twofold
