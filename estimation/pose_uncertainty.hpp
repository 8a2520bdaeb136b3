#pragma once

#include <algorithm>
#include <optional>
#include <span>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"

namespace twofold {

/// How much larger, or smaller, the covariance of poses is than the rig's noise says: the variance factor
/// that adjustments estimate afterwards from their residuals, here from regions of the image.
///
/// (J^T W J)^-1 takes every measurement to err by itself and as the rig says. Both are wrong: noise depends
/// on camera, light and texture, and what lies side by side errs together, because its points hang on the
/// same keyframes and lens, shutter and depth sensor bend regions and not pixels. Residuals show both. With
/// g_r = sum of J^T W e over the inliers of region r the covariance is C S C, S = sum g_r g_r^T, whatever the
/// errors are within a region (the sandwich of Huber 1967, clusters of Liang and Zeger 1986); six of k
/// regions are lost to the pose. Of that only the size is taken, tr(S C) / 6 k / (k - 6): one frame's regions
/// are too few for a matrix. It is smoothed over frames.
///
/// What all residuals of a frame hide, an error that the pose itself takes up, is not in it.
class VarianceFactor {
 public:
  /// One frame's residuals, of which every third frame's are looked at. A frame with few regions says
  /// nothing. No allocation.
  /// @param observations  as the solver, with `options`, left them, of which `motion` is the result
  void update(const Rig& rig, std::span<const MotionObservation> observations, const MotionOnlyResult& motion,
              const MotionOnlyOptions& options);

  /// One frame's pose from some of its measurements against that from all of them (split_factor): what all
  /// measurements of the others have in common shows there, and not between regions.
  void add_split(double factor);

  /// The larger of both; 1 before the first frame.
  [[nodiscard]] double value() const { return std::max(regions_.value_or(1), split_.value_or(0)); }

 private:
  std::optional<double> regions_, split_;
  unsigned frames_ = 0;
};

/// Squared difference of a pose that some measurements give from the one that all give, over its covariance
/// C_some - C_all (Hausman 1978) and its six dimensions.
/// @param apart  log(T_all T_some^-1)
/// @return  nothing when the others would not determine a pose
[[nodiscard]] std::optional<double> split_factor(const Matrix6& information_of_all,
                                                 const Matrix6& information_of_some, const Vector6& apart);

/// J^T W J e, summed over the inliers: what moves the pose if rows are read one after the other, for one
/// second a frame, and nobody knows. e is how far each point moves until its row is read.
/// @param velocity  of the camera, left perturbation (v, omega) a second
[[nodiscard]] Vector6 readout_force(const Rig& rig, std::span<const MotionObservation> observations,
                                    const MotionOnlyResult& motion, const Vector6& velocity,
                                    const MotionOnlyOptions& options);

/// Inverse of `variance_factor` information^-1 + b b^T, b = information^-1 force: of a pose that a force of
/// so many standard deviations pushes, nobody knows which way.
[[nodiscard]] Matrix6 information_under(const Matrix6& information, double variance_factor,
                                        const Vector6& force);

}  // namespace twofold
