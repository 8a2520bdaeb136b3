#pragma once

#include <optional>
#include <span>

#include "geometry/se3.hpp"

namespace twofold {

/// The axis that an object turned about before a camera that stood still, in the object's frame.
struct TurntableAxis {
  Vector3 direction{0, 0, 1};  ///< unit, up
  Vector3 point{0, 0, 0};      ///< on the axis, beside the cameras [m]
  double rate = 0;             ///< of the object, positive anticlockwise seen from above [rad/s]
  double turned = 0;           ///< in all, of the same sign [rad]
  double deviation = 0;        ///< of the camera's way from turning about the axis, root mean square [m]
};

/// Fits the axis to a way: camera centres c and rotations R of poses half a turn or less apart obey
/// c_j - p = dR (c_i - p), dR = R_j R_i^T, whose rotation vectors all lie along the axis. Pairs are 20
/// degrees apart. Nothing for fewer than two pairs, or where the way ends within ten degrees of where it
/// began, turning to and fro: it has no rate.
/// @param seconds  one a pose, growing
/// @param T_w_c    poses of the camera relative to the object
/// @param up       which of the two directions of the axis is up
[[nodiscard]] std::optional<TurntableAxis> fit_turntable_axis(std::span<const double> seconds,
                                                              std::span<const SE3> T_w_c, const Vector3& up);

}  // namespace twofold
