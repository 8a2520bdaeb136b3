#include "camera/rolling_shutter.hpp"

#include <algorithm>

#include "geometry/small_motion.hpp"

namespace twofold {
RollingShutter::RollingShutter(const Rig& rig, const Vector6& velocity)
    : at_rest_(rig.readout.value_or(0) == 0 || velocity.isZero(0)),
      velocity_(velocity),
      seconds_per_row_(rig.readout.value_or(0) / rig.camera.height),
      half_readout_(0.5 * rig.readout.value_or(0)) {}

StereoPixel RollingShutter::at_mid_exposure(const Rig& rig, const StereoPixel& z, const Vector3& x_c) const {
  if (at_rest_) return z;
  const Vector3 x_row = moved_by(tau(z.y()) * velocity_, x_c);
  if (!in_front_of_camera(x_c) || !in_front_of_camera(x_row)) return z;
  return z + rig.project(x_c) - rig.project(x_row);
}

SE3 RollingShutter::seen_from(const Rig& rig, const SE3& T_c_w, const Vector3& x_w) const {
  if (at_rest_) return T_c_w;
  const Vector3 x_c = T_c_w * x_w;
  return in_front_of_camera(x_c) ? T_row_c(rig.camera.project(x_c).y()) * T_c_w : T_c_w;
}

Vector2 followed_to_mid_exposure(const PinholeCamera& camera, const Vector2& uv, const Vector2& motion,
                                 double share) {
  const double tau = (uv.y() + 0.5) / camera.height - 0.5;
  // Between the two rows lies more than one interval when the corner goes down.
  const double intervals = std::max(1 + share * motion.y() / camera.height, 0.5);
  return uv - tau * share / intervals * motion;
}

}  // namespace twofold
