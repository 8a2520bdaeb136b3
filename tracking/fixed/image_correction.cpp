#include "tracking/fixed/image_correction.hpp"

#include <algorithm>

namespace twofold {
ImageCorrection::ImageCorrection(const Rig& rig, const FixedPixelOptions& options,
                                 const RightRowsOptions& right_rows)
    : options_(options),
      image_motion_(rig.camera),
      fixed_(rig.camera.width, rig.camera.height, options),
      has_depth_(rig.kind == SensorKind::kRgbd) {
  if (rig.kind != SensorKind::kStereo) return;
  right_rows_.emplace(rig, right_rows);
  fixed_right_.emplace(rig.camera.width, rig.camera.height, options);
}

void ImageCorrection::load(const Frame& frame, FrameImages& images) {
  images.left.build(frame.left, fixed_.dead());
  if (right_rows_) {
    load_right(frame, images.right);
    if (right_rows_->look_at_start(frame.left, images.right.level(0))) load_right(frame, images.right);
  }
  if (has_depth_) frame.depth.copyTo(images.depth);
}

void ImageCorrection::load_right(const Frame& frame, ImagePyramid& right) {
  // Moving rows by part of one has spread dead pixels over their neighbours.
  const bool as_taken = right_rows_->offset() == 0;
  right.build(right_rows_->aligned(frame.right),
              as_taken ? fixed_right_->dead() : std::span<const cv::Point>());
}

void ImageCorrection::advance(const std::optional<SE3>& T_this_previous) {
  if (T_this_previous) {
    image_motion_.advance(*T_this_previous);
  } else {
    image_motion_.restart();
  }
}

void ImageCorrection::learn(const Frame& frame, std::span<double> inverse_depths) {
  if (inverse_depths.empty()) {
    image_motion_.restart();
    return;
  }
  const auto far =
      inverse_depths.begin() +
      static_cast<std::ptrdiff_t>(options_.far_share * static_cast<double>(inverse_depths.size()));
  std::nth_element(inverse_depths.begin(), far, inverse_depths.end());
  image_motion_.set_inverse_depths(*far, options_.nearer * *std::max_element(far, inverse_depths.end()));
  fixed_.look_at(frame.left, frame.t_ns, image_motion_);
  if (fixed_right_) fixed_right_->look_at(frame.right, frame.t_ns, image_motion_);
}

void ImageCorrection::look_at_keyframe(const FrameImages& images) {
  if (right_rows_) right_rows_->look_at_keyframe(images.left.level(0), images.right.level(0));
}

}  // namespace twofold
