#pragma once

#include <array>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "twofold/types.hpp"

namespace twofold {

struct BoardCalibration;

/// A camera and its lens in numbers, named as in ROS' sensor_msgs/CameraInfo. With binning or a region of
/// interest there, size, K and P must be made those of the images first.
struct CameraInfo {
  int width = 0, height = 0;  ///< of the raw images [px]
  /// plumb_bob (k1 k2 p1 p2 [k3]), rational_polynomial (k1 k2 p1 p2 k3 k4 k5 k6) or equidistant (k1 k2 k3
  /// k4); docs/calibration.md has their equations.
  std::string distortion_model = "plumb_bob";
  std::vector<double> D = {};    ///< zeros at the end may be left out; empty: no distortion
  std::array<double, 9> K = {};  ///< fx 0 cx  0 fy cy  0 0 1 [px], by rows
  /// Of a pair whose pose between is not given: rotation from the raw to the rectified camera, and the
  /// rectified camera, P[3] = -fx * baseline of the right one, both by rows.
  std::array<double, 9> R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 12> P = {};
};

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
  /// One camera by its K and D, as the file of the same numbers; what its R and P would make of the images
  /// is not looked at. rig().readout is left open: in a copy of rig(), say what is known,
  /// depth_unit for depth images of whole numbers alone.
  ///
  /// @param sensor  kMono; kRgbd: with depth images that are the camera's, pixel by pixel
  ///
  /// Throws std::invalid_argument naming what is wrong, with its value; so do the others below.
  explicit FrameRectifier(const CameraInfo& camera, Sensor sensor = Sensor::kMono);
  /// A stereo pair: K and D are its lenses, R and P say how the cameras stand to each other, and no more:
  /// the rectified images are this class' own, rig() is not P, and T_rectified_raw() is not R.
  FrameRectifier(const CameraInfo& left, const CameraInfo& right);
  /// A stereo pair by K, D and the left camera's pose in the right one [m] (OpenCV's R, T of stereoCalibrate;
  /// twofold/eigen.hpp makes a Pose of them).
  FrameRectifier(const CameraInfo& left, const CameraInfo& right, const Pose& T_right_left);
  /// What a BoardCalibrator found.
  explicit FrameRectifier(const BoardCalibration& calibration);
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
