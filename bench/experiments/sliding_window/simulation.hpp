#pragma once

#include <random>
#include <vector>

#include "filters/sliding_window_filter.hpp"

namespace twofold::bench {

/// The rig of SWF 4: 1024 x 768, about 25 degrees, baseline 10 cm.
[[nodiscard]] Rig landing_rig();

/// One simulated run: true poses (the first is the identity), true landmarks, measurements without outliers.
struct Run {
  std::vector<SE3> T_c_w;
  std::vector<Vector3> landmarks;  ///< by id
  std::vector<FilterFrame> frames;
};

struct RunOptions {
  int frames = 10;
  int landmarks = 150;  ///< per view (sideways) or in all (descent)
  double noise_px = 0.5;
  double range = 10;         ///< of the wall at the first frame [m]
  double relief = 0.15;      ///< standard deviation of the wall's relief [m]
  Vector3 step{0, 0, 0.15};  ///< camera motion a frame [m]
  double wobble = 0.002;     ///< standard deviation of the rotation about the nominal one [rad]
  double overlap_axis =
      0;  ///< > 0: landmarks are spread along x so that about `landmarks` are seen in every view
};

[[nodiscard]] Run simulate(const Rig& rig, const RunOptions& options, unsigned seed);

/// Mean squared distance of estimated to true landmarks after the rigid motion that fits them best: error of
/// the structure, without that of the first camera's pose against it.
[[nodiscard]] double structure_error(const SlidingWindowFilter& filter, const Run& run);
/// The same without alignment.
[[nodiscard]] double absolute_error(const SlidingWindowFilter& filter, const Run& run);
/// Mean squared distance in the newest camera's frame over the landmarks it sees.
[[nodiscard]] double camera_relative_error(const SlidingWindowFilter& filter, const Run& run);

/// e^T Sigma^-1 e.
[[nodiscard]] double pose_nees(const SE3& estimate, const SE3& truth, const Matrix6& covariance);

/// Two-sided 95 % bounds of the mean of `trials` chi-square variables of `dof` degrees (Wilson-Hilferty).
struct Bounds {
  double low = 0, high = 0;
  [[nodiscard]] bool contains(double v) const { return v >= low && v <= high; }
};
[[nodiscard]] Bounds nees_bounds(int dof, int trials);

}  // namespace twofold::bench
