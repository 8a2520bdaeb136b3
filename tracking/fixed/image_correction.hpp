#pragma once

#include <optional>
#include <span>

#include "camera/frame.hpp"
#include "camera/rig.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/right_rows.hpp"
#include "tracking/fixed/fixed_pixels.hpp"
#include "tracking/fixed/image_motion.hpp"

namespace twofold {

/// What images go through before they are tracked: rows of a right image are moved to those of the left one,
/// dead pixels repaired. How rows lie is learnt from the first frames and from keyframes, which pixels are
/// dead or move with the camera from the frames that were tracked.
///
/// No allocation after construction.
class ImageCorrection {
 public:
  ImageCorrection(const Rig& rig, const FixedPixelOptions& options, const RightRowsOptions& right_rows);

  /// @param images  of the frame as it is tracked; made by `allocate_images`
  void load(const Frame& frame, FrameImages& images);

  /// A frame has a pose.
  /// @param T_this_previous  its motion since the frame before; nothing if that is not known
  void advance(const std::optional<SE3>& T_this_previous);
  /// What stays the same in the frame advanced to, while the camera moves, moves with it.
  /// @param inverse_depths  of points that are tracked [1/m], reordered. Empty: the pose is in doubt and
  ///                        proves nothing; if something that passes has taken it along, the scene itself
  ///                        would seem fixed.
  void learn(const Frame& frame, std::span<double> inverse_depths);
  /// A keyframe: whether the rows still fit.
  void look_at_keyframe(const FrameImages& images);

  /// What moves with the left camera.
  [[nodiscard]] const FixedPixels& fixed() const { return fixed_; }
  /// RightRows::offset, 0 without a right camera.
  [[nodiscard]] double row_offset() const { return right_rows_ ? right_rows_->offset() : 0; }

 private:
  void load_right(const Frame& frame, ImagePyramid& right);

  FixedPixelOptions options_;
  ImageMotion image_motion_;
  FixedPixels fixed_;
  std::optional<FixedPixels> fixed_right_;  ///< stereo only, as the next
  std::optional<RightRows> right_rows_;
  bool has_depth_;
};

}  // namespace twofold
