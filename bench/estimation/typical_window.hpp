#pragma once

#include "fixtures/synthetic_window.hpp"

namespace twofold {

/// 25 inner and 175 outer keyframes after more than a lap, with noise and mismatches like a real map's.
inline SyntheticWindowOptions typical_window_options() {
  SyntheticWindowOptions options;
  options.inner = 25;
  options.outer = 175;
  options.laps = 1.6;
  options.points_per_keyframe = 70;
  options.pixel_noise = 0.7;
  options.outliers = 0.03;
  options.missing_right = 0.2;
  options.constraint_noise = 0.005;
  options.start_pose_noise = 0.01;
  options.start_depth_noise = 0.05;
  return options;
}

}  // namespace twofold
