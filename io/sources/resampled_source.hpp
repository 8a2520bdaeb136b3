#pragma once

#include <memory>

#include "camera/pinhole.hpp"
#include "io/sources/frame_source.hpp"

namespace twofold {

/// Passes another source's images on at the angular resolution of a given camera, all of its field of view:
/// as if that lens had a smaller or larger sensor behind it. One camera, rectified; no lens has more in it
/// than it had, so that an enlarged image is smooth.
class ResampledSource final : public FrameSource {
 public:
  /// Throws IoError when the images would be enlarged or reduced more than four times, or be empty.
  ResampledSource(std::unique_ptr<FrameSource> source, const PinholeCamera& like);

  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return source_->frame_count(); }
  [[nodiscard]] bool is_live() const override { return source_->is_live(); }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }

 private:
  bool read(Frame& frame) override;

  std::unique_ptr<FrameSource> source_;
  Frame own_;
};

}  // namespace twofold
