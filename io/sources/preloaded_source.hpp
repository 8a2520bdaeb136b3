#pragma once

#include <memory>
#include <vector>

#include "io/sources/frame_source.hpp"

namespace twofold {

/// All frames of another source, decoded or rendered beforehand and kept in memory, so that nothing but the
/// engine runs while it is timed; colour, which few frames are wanted in, is decoded when it is asked for.
/// next costs a few reference counts; the images are shared, never copied.
class PreloadedSource final : public FrameSource {
 public:
  /// Drains `source`. Throws IoError with its message when it fails, or when the images exceed max_bytes.
  explicit PreloadedSource(std::unique_ptr<FrameSource> source, std::size_t max_bytes = kDefaultMaxBytes);
  [[nodiscard]] std::optional<std::int64_t> frame_count() const override {
    return static_cast<std::int64_t>(frames_.size());
  }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    return source_->colour_image(index);
  }
  [[nodiscard]] std::optional<TriangleMesh> true_surface() const override { return source_->true_surface(); }

  static constexpr std::size_t kDefaultMaxBytes = std::size_t{8} << 30;

 private:
  bool read(Frame& frame) override;

  std::unique_ptr<FrameSource> source_;  // drained
  std::vector<Frame> frames_;
  std::size_t next_ = 0;
};

}  // namespace twofold
