#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <string>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"
#include "estimation/region_sums.hpp"

namespace twofold {

struct PoseUncertaintyOptions {
  double newest_regions = 0.25;  ///< share of the newest frame in what regions say, in (0, 1]
  double newest_split = 0.1;     ///< the same of splits, of which there are fewer, in (0, 1]
  double of_frame = 0.5;         ///< share of a frame's own residuals in its covariance, in [0, 1]

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// How well poses are known, as residuals say.
///
/// (J^T W J)^-1 takes every measurement to err by itself and as the rig says. Both are wrong: noise depends
/// on camera, light and texture, and what lies side by side errs together, because its points hang on the
/// same keyframes and lens, shutter and depth sensor bend regions and not pixels. Residuals show both. The
/// size of what they show is smoothed over frames; one frame's regions are too few for a matrix. But where a
/// frame hangs on few measurements that err, it alone shows it, so that a part of the covariance is the
/// frame's own (RegionSums::jackknife).
///
/// What all residuals of a frame hide, an error that the pose itself takes up, is not in it.
class PoseUncertainty {
 public:
  explicit PoseUncertainty(const Rig& rig, const PoseUncertaintyOptions& options = {})
      : rig_(rig), options_(options), sums_(rig.camera) {}

  /// One frame's residuals. A frame with few regions says nothing. No allocation.
  /// @param observations  as the solver, with `options`, left them, of which `motion` is the result
  /// @param all_agree     the pose is that of all of them; otherwise residuals are no measure of it
  void update(std::span<const MotionObservation> observations, const MotionOnlyResult& motion,
              const MotionOnlyOptions& options, bool all_agree);

  /// One frame's pose from some of its measurements against that from all of them (split_factor): what all
  /// measurements of the others have in common shows there, and not between regions.
  void add_split(double factor);

  /// The larger of what regions and splits say; 1 before the first frame.
  [[nodiscard]] double variance_factor() const { return std::max(regions_.value_or(1), split_.value_or(0)); }

  /// Of a pose with this J^T W J. The frame's own share is that of the last update.
  [[nodiscard]] Matrix6 covariance(const Matrix6& information) const;
  /// RegionSums::by_rows of the last update.
  [[nodiscard]] const Matrix6& by_rows() const { return sums_.by_rows(); }

 private:
  Rig rig_;
  PoseUncertaintyOptions options_;
  RegionSums sums_;
  std::optional<double> regions_, split_;
  std::optional<Matrix6> of_frame_;
};

/// Squared difference of a pose that some measurements give from the one that all give, over its covariance
/// C_some - C_all (Hausman 1978) and its six dimensions.
/// @param apart  log(T_all T_some^-1)
/// @return  nothing when the others would not determine a pose
[[nodiscard]] std::optional<double> split_factor(const Matrix6& information_of_all,
                                                 const Matrix6& information_of_some, const Vector6& apart);

}  // namespace twofold
