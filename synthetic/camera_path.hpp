#pragma once

#include <functional>
#include <vector>

#include "geometry/se3.hpp"

namespace twofold::synthetic {

/// T_w_c [m] at time t [s], smooth in t and defined for all t >= 0.
using CameraPath = std::function<SE3(double t)>;

/// Pose of a camera at `position` that looks along the horizontal heading `yaw` (0: +x, pi/2: +y), turned up
/// by `pitch` and clockwise about its optical axis by `roll` [rad]. World z is up.
[[nodiscard]] SE3 looking(const Vector3& position, double yaw, double pitch, double roll);

/// Closed smooth curve in the plane: a uniform cubic B-spline over a ring of control points, walked by arc
/// length.
class ClosedCurve {
 public:
  explicit ClosedCurve(std::vector<Vector2> control_points);

  [[nodiscard]] double length() const { return arc_.back(); }
  /// s [m] may be any number: the curve repeats with its length.
  [[nodiscard]] Vector2 position(double s) const;
  /// Direction of motion [rad], in (-pi, pi].
  [[nodiscard]] double heading(double s) const;

 private:
  [[nodiscard]] double parameter(double s) const;
  [[nodiscard]] Vector2 at(double parameter) const;
  [[nodiscard]] Vector2 tangent(double parameter) const;

  std::vector<Vector2> points_;
  std::vector<double> arc_;  ///< arc length at parameters k / kStepsPerSpan
};

struct WalkStyle {
  double speed = 1.4;          ///< [m/s]
  double eye_height = 1.6;     ///< [m]
  double look_aside_deg = 22;  ///< amplitude of the glances to either side
  double outward_deg = 0;      ///< mean turn to the right of the direction of motion
  double pitch_deg = -2;
};

/// Walking along the curve: the head bobs at step frequency, sways, nods and glances aside; the line walked
/// strays from the curve by up to 0.2 m, in each round by another way.
[[nodiscard]] CameraPath walk(const ClosedCurve& curve, const WalkStyle& style);

/// The path as a quadrotor in a hurry takes it: the camera swings about it in all six degrees of freedom, in
/// its own axes: with amplitude 1 by up to 0.47 m and 27 degrees, at up to 1.3 m/s and 124 degrees/s.
[[nodiscard]] CameraPath flown(CameraPath path, double amplitude);

}  // namespace twofold::synthetic
