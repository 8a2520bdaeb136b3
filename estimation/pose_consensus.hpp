#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "estimation/motion_only.hpp"

namespace twofold {

/// Pose from matches of which most may be wrong; see PoseConsensus.
struct PoseConsensusOptions {
  double inlier_sigmas = 4;  ///< reprojection error of an inlier, > 0: a pose of three noisy depths is rough
  int max_samples = 400;     ///< RANSAC draws at most, >= 1
  double confidence = 0.99;  ///< of having drawn three inliers, in (0, 1)
  double min_disparity_px = 0.5;  ///< farther points are not drawn: their depth is a guess, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Pose that explains most of the matches, of which most may be wrong: three-point RANSAC on the points that
/// have a right coordinate, hence a position in both frames (Arun, thesis eq. 5.11 - 5.14 and 6.9). Residuals
/// are reprojection errors in the left image in standard deviations.
///
/// Buffers are reserved at construction; at most `capacity` matches are used.
class PoseConsensus {
 public:
  PoseConsensus(const Rig& rig, std::size_t capacity, const PoseConsensusOptions& options);

  /// @return nothing when fewer than `min_inliers` matches agree
  [[nodiscard]] std::optional<SE3> find(std::span<const MotionObservation> matches, int min_inliers);

  /// Whether the match is an inlier of a pose found.
  [[nodiscard]] bool explains(const SE3& T_c_ref, const MotionObservation& match) const;

 private:
  /// A point in both frames.
  struct Pair {
    Vector3 x_ref, x_c;
  };
  static constexpr std::size_t kObservationLanes = 4;
  using ObservationLanes = double __attribute__((vector_size(sizeof(double) * kObservationLanes)));
  /// What four pairs' residuals are computed from, side by side.
  struct Batch {
    ObservationLanes x, y, z;            ///< in the reference frame
    ObservationLanes u, v, information;  ///< in the left image
  };
  class ThreePoints;

  void add(const MotionObservation& match, const Vector3& x_c);

  Rig rig_;
  PoseConsensusOptions options_;
  std::vector<Pair> pairs_;
  std::vector<Batch> batches_;  ///< of the pairs; the last one is filled up with points that are nowhere
  std::vector<SE3> models_;
};

}  // namespace twofold
