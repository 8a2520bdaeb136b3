#pragma once

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "graph/place_appearance.hpp"

namespace twofold {

/// A corner of view b and the corner of one of a place's views that it is taken for.
struct CornerMatch {
  int view = 0;  ///< of the place
  int corner = 0;
  int b = 0;
  Vector3 x_a;  ///< the place's point, in the frame of the place's own view [m]
};

/// Whether a corner's depth is known and it is near enough to tell about translation.
[[nodiscard]] inline bool has_depth(const StereoPixelF& z, double min_disparity_px) {
  return z.x() - z.z() > min_disparity_px;  // false for NaN
}

/// Factor that turns a squared error in level-0 pixels into one in pixels of `level`.
[[nodiscard]] inline double per_squared_pixel(int level) {
  return std::ldexp(1.0, -2 * level);
}

/// Error of a measurement in units of the pixels of its level, squared; infinite behind the camera. Of one
/// camera's only in the left image: its u_r stands for the depth that the map has there, not for a
/// measurement.
/// @param per_pixel  per_squared_pixel of its level
[[nodiscard]] inline double squared_error(const Rig& rig, const Vector3& x, const StereoPixelF& z,
                                          double per_pixel) {
  if (!in_front_of_camera(x)) return std::numeric_limits<double>::infinity();
  const Vector3 e = rig.project(x) - z.cast<double>();
  const double squared = rig.kind == SensorKind::kMono ? e.head<2>().squaredNorm() : e.squaredNorm();
  return squared * per_pixel;
}

/// By how much directions in the image turn from view a to view b, the part of the rotation about the
/// camera's axis [rad], positive from x to y; a factor of scale makes no difference.
[[nodiscard]] inline double turn_of(const Matrix3& R_b_a) {
  return std::atan2(R_b_a(1, 0) - R_b_a(0, 1), R_b_a(0, 0) + R_b_a(1, 1));
}

/// Whether two angles are no more than `bound` apart, full turns aside.
[[nodiscard]] inline bool nearly_same_direction(double angle_0, double angle_1, double bound) {
  constexpr double kRound = 2 * std::numbers::pi;
  const double apart = angle_0 - angle_1;
  return std::abs(apart - kRound * std::nearbyint(apart / kRound)) <=
         bound;  // remainder() takes 5 times as long
}

/// Pose that fits the matches best, found from T_b_a on; T_b_a itself when the solver does not converge.
[[nodiscard]] SE3 fit_pose_to_corners(const Rig& rig, const PlaceAppearance& b,
                                      const std::vector<CornerMatch>& matches, const SE3& T_b_a);

}  // namespace twofold
