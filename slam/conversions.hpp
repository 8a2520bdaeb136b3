#pragma once

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "twofold/types.hpp"

namespace twofold {

// Between the types of the public face and those inside.

[[nodiscard]] Pose to_pose(const SE3& T_a_b);
[[nodiscard]] SE3 to_se3(const Pose& T_a_b);

[[nodiscard]] CameraRig to_camera_rig(const Rig& rig);
/// Throws std::invalid_argument naming the field, the rule and the value.
[[nodiscard]] Rig to_rig(const CameraRig& rig);

}  // namespace twofold
