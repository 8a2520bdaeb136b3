#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/focal_length.hpp"
#include "estimation/motion_only.hpp"

namespace twofold {

/// The focal length with which frames of one camera fit into a map of known points: motion-only adjustment of
/// each with the scale of fx and fy as one unknown more, which all frames share. The principal point is taken
/// to be right, and right coordinates are left out of account.
///
/// Of each frame only what it says of the scale is kept: its pose is eliminated (Schur complement), at the
/// scale that all frames so far gave. No allocation after construction; O(observations) a frame.
class FocalResection {
 public:
  /// @param max_observations  of a frame
  FocalResection(const Rig& rig, std::size_t max_observations, const MotionOnlyOptions& options);

  /// One more frame.
  /// @param observations  what it saw of the map, outliers included: they are judged anew
  /// @param T_c_ref       its pose with the rig's focal length; points are in frame ref
  void add(std::span<const MotionObservation> observations, const SE3& T_c_ref);

  /// @return  nothing where too few frames say anything of it; its standard deviation is as large as the
  ///          frames are apart, if they are further apart than their noise explains
  [[nodiscard]] std::optional<FocalLengthEstimate> estimate() const;

 private:
  [[nodiscard]] double log_scale() const;

  const Rig rig_;
  const MotionOnlyOptions options_;
  std::vector<MotionObservation> observations_;  ///< scratch
  /// Over frames, of the logarithm of the scale: its information, and that times the value and its square.
  double information_ = 0, weighted_sum_ = 0, weighted_squares_ = 0;
  int frames_ = 0;
};

}  // namespace twofold
