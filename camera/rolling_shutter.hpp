#pragma once

#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// The camera's motion while a rolling shutter reads one frame out: its rows see the scene one after the
/// other, and the pose of the frame is that of its middle row,
///
///   T_row_w = exp(tau xi) T_c_w,   tau = ((v + 0.5) / height - 0.5) readout.
///
/// Points and measurements at mid-exposure are as a global shutter would have had them, so that only who
/// reads images needs to know of this. Pairs are taken to read the same row at the same time, rectification
/// to leave rows about where they were.
class RollingShutter {
 public:
  /// A global shutter, or a camera at rest: all functions return what they are given.
  RollingShutter() = default;
  /// @param velocity  xi = (v, omega), left perturbation of T_c_w a second [m/s, rad/s]
  RollingShutter(const Rig& rig, const Vector6& velocity);

  [[nodiscard]] bool at_rest() const { return at_rest_; }
  /// Pose of the camera at pixel row v relative to that at mid-exposure.
  [[nodiscard]] SE3 T_row_c(double v) const { return at_rest_ ? SE3() : SE3::exp(tau(v) * velocity_); }
  /// The pose of the camera at pixel row v when it is at T_c_w at mid-exposure.
  [[nodiscard]] SE3 at_row(double v, const SE3& T_c_w) const { return at_rest_ ? T_c_w : T_row_c(v) * T_c_w; }
  /// Where a point was seen, moved to where it would have been at mid-exposure.
  /// @param x_c  the point at mid-exposure [m], in front of the camera; need be known roughly only
  [[nodiscard]] StereoPixel at_mid_exposure(const Rig& rig, const StereoPixel& z, const Vector3& x_c) const;
  /// The pose T_c_w at which a point is seen: at mid-exposure, moved to the row on which it is expected.
  [[nodiscard]] SE3 seen_from(const Rig& rig, const SE3& T_c_w, const Vector3& x_w) const;

 private:
  [[nodiscard]] double tau(double v) const { return (v + 0.5) * seconds_per_row_ - half_readout_; }

  bool at_rest_ = true;
  Vector6 velocity_ = Vector6::Zero();
  double seconds_per_row_ = 0;
  double half_readout_ = 0;
};

/// Where a global shutter would have seen a corner at mid-exposure, by how the corner itself moves: neither
/// its depth nor the camera's motion need be known.
/// @param motion  of the corner from a frame to the next, one of them that of uv [px]
/// @param share   of the time between the two, that the rows take to be read, in [0, 1]
[[nodiscard]] Vector2 followed_to_mid_exposure(const PinholeCamera& camera, const Vector2& uv,
                                               const Vector2& motion, double share);

}  // namespace twofold
