#pragma once

#include <string>

namespace twofold {

/// How far the camera may be from where it was last (tracking/motion/motion_model.hpp).
struct MotionModelOptions {
  /// While lost, so long after the last pose, the camera is looked for first where it is if it went on as it
  /// moved [s]; later, if it is within reach of where it then was.
  double coast_for = 1.5;
  /// A pose from a rough start, in metres, may be so far from where the camera would be had it gone on: by
  /// what an acceleration adds [m/s^2], and by what the poses themselves err [m].
  double max_acceleration = 10;
  double reach_slack = 0.5;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
