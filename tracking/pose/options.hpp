#pragma once

#include <string>

#include "estimation/motion_only.hpp"
#include "estimation/pose_uncertainty.hpp"
#include "tracking/common/elder_vote.hpp"

namespace twofold {

/// What a pose from a rough start must explain (SearchStart::Kind): from a wrong one some points are found as
/// well, but few agree.
struct RoughStartOptions {
  double inlier_share = 0.6;    ///< of the points found, in (0, 1],
  double searched_share = 0.2;  ///< of those searched, in (0, 1],
  int min_inliers = 40;         ///< and so many points, >= 0, or
  int min_mapped = 10;          ///< so many that the map has, seen from two places, >= 0
  int rounds = 3;               ///< searches, each from the pose that the one before gave, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Which pose fits the points that were found, and whether it is believed (tracking/pose/pose_estimator.hpp).
struct PoseOptions {
  /// A step of 1e-5 moves no projection by a hundredth of a pixel. Outliers: beyond 99 % of chi-square,
  /// because real errors (rolling shutter, calibration, depth of a point seen from one place only) have long
  /// tails.
  MotionOnlyOptions motion{
      .max_iterations = 15, .inlier_chi2_mono = 9.210, .inlier_chi2_stereo = 11.345, .stop_step = 1e-5};
  ElderVoteOptions elders;

  int min_inliers = 18;            ///< inliers, >= 3; fewer: lost
  double min_inlier_share = 0.25;  ///< of the matches found, in [0, 1]; with fewer inliers the frame is lost
  /// A pose is doubted, and a wider search may find a better one, with inliers below doubted_searched_share
  /// of the points searched; or below doubted_inlier_share of the matches and rough.searched_share of the
  /// points searched. Both in (0, 1].
  double doubted_inlier_share = 0.5;
  double doubted_searched_share = 0.12;
  /// Where dense alignment and the motion so far disagree, both are tried, unless so large a share of the
  /// points searched agrees on a pose already, in [0, 1]; 0: never. Poses that a passing object gave have up
  /// to 0.31.
  double settled_searched_share = 0.35;
  RoughStartOptions rough;
  /// Where rows are read one after the other, how they move follows from the pose, and that from it, >= 1.
  int shutter_rounds = 3;
  /// A round that moves the pose by less is the last, >= 0 [standard deviations]: the next one would move it
  /// by about a twentieth of that.
  double shutter_settled = 1;
  PoseUncertaintyOptions uncertainty;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
