#pragma once

#include <filesystem>
#include <memory>

#include "io/sources/frame_source.hpp"
#include "io/sources/recorder.hpp"

namespace twofold {

/// Passes another source's frames on and records each, so that a live run can be repeated from the recording
/// and its schedule log. Frames are numbered as the reader of the recording will number them. Stereo and
/// mono.
class RecordingTee final : public FrameSource {
 public:
  /// Throws IoError when the recording cannot be begun.
  RecordingTee(std::unique_ptr<FrameSource> source, const std::filesystem::path& folder,
               const RecorderOptions& options = {});

  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return source_->frame_count(); }
  [[nodiscard]] bool is_live() const override { return source_->is_live(); }
  [[nodiscard]] bool is_raw() const override { return source_->is_raw(); }
  /// The source's, and what was recorded.
  [[nodiscard]] SourceReport report() const override;
  /// Writes what is still queued, after the last frame. What of the delivered frames is not in the recording,
  /// and why; empty: all are.
  [[nodiscard]] std::string finish();
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    return source_->colour_image(index);
  }
  [[nodiscard]] std::optional<TriangleMesh> true_surface() const override { return source_->true_surface(); }

 private:
  bool read(Frame& frame) override;

  std::unique_ptr<FrameSource> source_;
  std::filesystem::path folder_;
  Recorder recorder_;
  std::int64_t next_index_ = 0;
};

}  // namespace twofold
