#pragma once

#include <span>
#include <string>

#include "camera/measurement.hpp"
#include "camera/rig.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// A point known in a reference frame and its measurement in the frame whose pose is sought.
struct MotionObservation {
  Vector3 x_ref{0, 0, 1};                ///< point in the reference frame [m]
  StereoPixelF pixel{0, 0, 0};           ///< u_r is ignored unless weighs_right(information)
  Eigen::Vector3f information{1, 1, 1};  ///< diagonal [1/px^2]; see observe_point
  bool inlier = true;                    ///< set by the solver: chi2 below the threshold at the result
};

/// Point and measurement as motion-only adjustment takes them, weighed by the rig's noise on the pyramid
/// level that the pixel was measured on.
[[nodiscard]] inline MotionObservation observe_point(const Rig& rig, const Vector3& x_ref,
                                                     const StereoPixelF& z, int level) {
  return {x_ref, z, rig.information(z, level)};
}

struct MotionOnlyOptions {
  int max_iterations = 10;            ///< of a round, >= 1
  double huber_sigmas = 1.5;          ///< on the whitened residual norm; <= 0: no kernel
  double inlier_chi2_mono = 5.991;    ///< 95 % of chi-square with 2 degrees of freedom, > 0
  double inlier_chi2_stereo = 7.815;  ///< 95 % of chi-square with 3 degrees of freedom, > 0
  int rounds = 2;           ///< outliers are put aside after each and judged again in the next, >= 1
  double stop_step = 1e-7;  ///< stop when the step is smaller (norm of the tangent vector), >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct MotionOnlyResult {
  SE3 T_c_ref;
  Matrix6 information = Matrix6::Zero();  ///< J^T W J at the result over the inliers (left perturbation);
                                          ///< invert for the covariance
  double chi2 = 0;                        ///< robustified, over inliers
  int inliers = 0;
  bool determined = false;  ///< the inliers do; otherwise T_c_ref is the start value
  bool converged = false;
};

/// Motion-only bundle adjustment: pose of one frame from matched points  (thesis eq. 3.34 / 4.15), robust.
/// No allocation; at most rounds * max_iterations passes over the observations. Fewer than three usable
/// observations, or a singular system: the pose is not determined.
[[nodiscard]] MotionOnlyResult optimise_motion(const Rig& rig, std::span<MotionObservation> observations,
                                               const SE3& T_c_ref_start, const MotionOnlyOptions& options);

/// Sets which of the observations are inliers at T_c_ref, and returns how many.
int classify_observations(const Rig& rig, std::span<MotionObservation> observations, const SE3& T_c_ref,
                          const MotionOnlyOptions& options);

}  // namespace twofold
