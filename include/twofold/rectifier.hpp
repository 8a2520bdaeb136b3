#pragma once

#include <filesystem>
#include <memory>

#include "twofold/types.hpp"

namespace twofold {

/// Makes the rectified frames that Slam takes of those that a camera gives: straight lines straight, and for
/// stereo, corresponding points in the same row. Sources do this by themselves.
///
/// Threads: rectify may be called by several at once.
class TWOFOLD_API FrameRectifier {
 public:
  /// @param calibration    file of any form that docs/calibration.md has, as `twofold calibrate` writes; or a
  ///                       folder in EuRoC's layout, which has a file a camera: both of cam0 and cam1 are
  ///                       read
  /// @param width, height  of the raw images [px], for files that do not state it, as KITTI's; 0: the file
  ///                       does
  /// @param left_only      of a folder in EuRoC's layout, cam0 alone, as one camera
  ///
  /// rig().sensor says for how many cameras it is. Throws std::runtime_error naming the file and what is
  /// wrong. EuRoC's file of one camera of a pair is refused: alone, it gives another rotation than the pair.
  explicit FrameRectifier(const std::filesystem::path& calibration, int width = 0, int height = 0,
                          bool left_only = false);
  ~FrameRectifier();
  FrameRectifier(FrameRectifier&&) noexcept;
  FrameRectifier& operator=(FrameRectifier&&) noexcept;

  /// What the rectified frames are of.
  [[nodiscard]] const CameraRig& rig() const;
  /// Rotation from the calibrated left camera, as its lens took the images (raw), to the rectified one that
  /// poses are of: p_rectified = T_rectified_raw * p_raw; identity for images that are rectified already. A
  /// robot's extrinsics are of the raw camera:
  ///
  ///   T_world_raw = compose(estimate.T_world_camera, rectifier.T_rectified_raw())
  ///   T_world_body = compose(T_world_raw, inverse(T_body_raw))  // T_body_raw: how the camera is mounted
  [[nodiscard]] Pose T_rectified_raw() const;
  /// @return  grey images, and depth, with an owner; those of `raw` themselves when they are rectified
  ///          already. Throws std::invalid_argument when `raw` is not of the calibrated cameras.
  [[nodiscard]] FrameView rectify(const FrameView& raw) const;
  /// The same, with the left image in colour (kBgr8) if `raw` has it so: what a SurfaceModel takes its
  /// colours from.
  [[nodiscard]] FrameView rectify_in_colour(const FrameView& raw) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
