#pragma once

#include "camera/calibration.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "twofold/calibration.hpp"
#include "twofold/rectifier.hpp"
#include "twofold/types.hpp"

namespace twofold {

// Between the types of the public face and those inside.

[[nodiscard]] Pose to_pose(const SE3& T_a_b);
[[nodiscard]] SE3 to_se3(const Pose& T_a_b);

/// Of finite numbers and a unit quaternion, as exactly as trajectory files have it.
[[nodiscard]] bool is_rigid_motion(const Pose& T_a_b);

[[nodiscard]] CameraRig to_camera_rig(const Rig& rig);
/// Throws std::invalid_argument naming the field, the rule and the value.
[[nodiscard]] Rig to_rig(const CameraRig& rig);

// What a file would say, from numbers; not checked as a whole yet, as a file's is not. All throw
// std::invalid_argument with the field and the value.

[[nodiscard]] Calibration to_calibration(const CameraInfo& camera, Sensor sensor);
[[nodiscard]] Calibration to_calibration(const CameraInfo& left, const CameraInfo& right);
[[nodiscard]] Calibration to_calibration(const CameraInfo& left, const CameraInfo& right,
                                         const Pose& T_right_left);
[[nodiscard]] Calibration to_calibration(const BoardCalibration& board);

}  // namespace twofold
