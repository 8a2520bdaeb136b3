#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "apps/twofold/surface/frame_colours.hpp"
#include "io/sources/frame_source.hpp"
#include "surface/object_mask.hpp"
#include "surface/submaps.hpp"

namespace twofold {

struct ObjectSourceOptions {
  ObjectMaskOptions mask;
  double nearest_stereo = 0.3;      ///< disparities are searched for up to that of this depth [m] > 0
  int keep_every = 5;               ///< frames whose depth is kept for the surface >= 1
  std::size_t max_bytes = 1 << 30;  ///< of kept depth and colour

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Another source's frames, of which nothing is left but an object: images are filled, depth is empty outside
/// its mask. Frames that show none are left out. The depth of every keep_every-th frame is kept, packed.
class ObjectSource final : public FrameSource {
 public:
  /// What fusion needs of a kept frame.
  struct Kept {
    std::int64_t t_ns = 0;
    Vector3 up_c{0, 0, 0};  ///< normal of the support plane, in the camera's frame
    KeyframeDepth images;
  };

  /// Options must be valid; the source stereo or RGB-D.
  ObjectSource(std::unique_ptr<FrameSource> source, const ObjectSourceOptions& options);

  [[nodiscard]] std::optional<std::int64_t> frame_count() const override { return source_->frame_count(); }
  [[nodiscard]] bool is_live() const override { return source_->is_live(); }
  [[nodiscard]] SourceReport report() const override { return source_->report(); }
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    return source_->colour_image(index);
  }

  [[nodiscard]] const std::vector<Kept>& kept() const { return kept_; }
  /// Where the colours of kept frames come from: SurfaceFigures::colour.
  [[nodiscard]] std::string colour() const { return colours_.text(); }
  /// What was left out, in words: frames without an object, depth beyond max_bytes, colours that cannot be
  /// read.
  [[nodiscard]] std::vector<std::string> left_out() const;
  /// Share of the frames that show an object in which it reaches the image's border.
  [[nodiscard]] double share_cut_off() const;
  /// Why no frame shows an object, once the source has ended; empty when one does.
  [[nodiscard]] std::string nothing_shown() const;

 private:
  bool read(Frame& frame) override;
  /// Masks the frame; false when it shows no object.
  bool mask(Frame& frame);
  /// @param depth  of the object alone; frame is not masked yet
  void keep(const Frame& frame, const cv::Mat& depth);

  std::unique_ptr<FrameSource> source_;
  ObjectSourceOptions options_;
  ObjectMasker masker_;
  std::vector<Kept> kept_;
  std::size_t kept_bytes_ = 0;
  int shown_ = 0, without_object_ = 0, not_kept_ = 0, cut_off_ = 0;
  FrameColours colours_;
  std::string reason_;  ///< of the last frame without an object
};

}  // namespace twofold
