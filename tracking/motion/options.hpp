#pragma once

#include <string>

#include "camera/readout_estimator.hpp"

namespace twofold {

/// How far the camera may be from where it was last (tracking/motion/motion_model.hpp).
struct MotionModelOptions {
  double jitter = 0.3;  ///< of the interval between two frames: by less stamps differ for nothing, >= 0
  /// While lost, so long after the last pose, the camera is looked for first where it is if it went on as it
  /// moved [s] >= 0; later, if it is within reach of where it then was.
  double coast_for = 1.5;
  /// A pose from a rough start, in metres, may be so far from where the camera would be had it gone on: by
  /// what an acceleration adds [m/s^2] > 0, and by what the poses themselves err [m] > 0.
  double max_acceleration = 10;
  double reach_slack = 0.5;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// A rolling shutter (tracking/motion/shutter_model.hpp).
struct ShutterOptions {
  ReadoutOptions readout;  ///< where the calibration does not have it
  /// Cameras either read all rows at once or take up to a frame's period: while nobody knows [s], > 0.
  double unknown_readout = 0.015;
  /// One camera: standard deviation that the estimator assumes of an inverse depth, as a share of it, because
  /// an unknown readout bends all depths of a place together, >= 0. Half of it makes readouts too small; more
  /// makes them known late.
  double bent_depth = 2;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
