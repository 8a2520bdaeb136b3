#pragma once

#include <string>

#include "camera/readout_estimator.hpp"
#include "estimation/motion_only.hpp"
#include "imaging/guided_search.hpp"
#include "tracking/dense_alignment.hpp"
#include "tracking/depth/depth_alignment.hpp"
#include "tracking/elder_vote.hpp"
#include "tracking/fixed/fixed_pixels.hpp"
#include "tracking/loss/wide_search.hpp"
#include "tracking/monocular/depth_seeds.hpp"
#include "tracking/monocular/first_structure.hpp"

namespace twofold {

/// Which earlier frames one camera's first motion is looked for from
/// (tracking/monocular/monocular_start.hpp).
struct MonocularStartOptions {
  int candidates = 4;           ///< earlier frames tried, the oldest being left out, >= 1
  int frames_between = 4;       ///< of a candidate and now, that tell motions apart, >= 2
  int longest_path = 64;        ///< frames since a candidate that get their poses afterwards, >= 2
  double placed_share = 0.6;    ///< of the start's points, that must agree on such a pose, in (0, 1]
  double next_flow = 0.03;      ///< share of the image's width that corners have moved by: a new candidate is
                                ///< worth its place, >= 0
  double min_left_share = 0.4;  ///< of its corners: a candidate with fewer is given up, in (0, 1]

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct TrackerOptions {
  DenseAlignmentOptions alignment;
  GuidedSearchOptions search;
  WideSearchOptions wide_search;
  ElderVoteOptions elders;
  DepthAlignmentOptions depth;
  ReadoutOptions readout;  ///< of a rolling shutter, where the calibration does not have it
  FixedPixelOptions fixed;
  double fixed_inlier_share =
      0.5;  ///< of the matches: with fewer inliers a pose is no witness of fixed pixels
  /// A step of 1e-5 moves no projection by a hundredth of a pixel. Outliers: beyond 99 % of chi-square,
  /// because real errors (rolling shutter, calibration, depth of a point seen from one place only) have long
  /// tails.
  MotionOnlyOptions motion{
      .max_iterations = 15, .inlier_chi2_mono = 9.210, .inlier_chi2_stereo = 11.345, .stop_step = 1e-5};

  int wanted_matches = 180;      ///< stop searching once so many points were found in a frame
  int max_searches = 320;        ///< upper bound of points searched in a frame
  int neighbour_keyframes = 20;  ///< the reference keyframe's: so many, those that share most points
  double border_px = 8;          ///< points predicted closer to the image's edge are not searched, >= 0
  double min_view_cosine = 0.7;  ///< of the angle between a point's first ray and today's, in [-1, 1]
  int min_inliers = 18;          ///< fewer: lost
  int scarce_inliers = 40;       ///< a depth camera with fewer is placed by its depth image as well, >= 0
  /// After a loss, a pose from the depth image alone is rejected when so many points should be seen from it
  /// and the search does not confirm it.
  int telling_candidates = 40;
  double min_inlier_share = 0.25;  ///< of the matches found; with fewer inliers the frame is lost
  double lost_radius_px = 8;       ///< search radius while lost
  /// The light has changed when so large a share of the points searched was missed ...
  double light_missed_share = 0.5;
  double light_change = 1.5;  ///< ... and the view is by so much brighter or darker there, > 1
  /// A pose is doubted, and a wider search may find a better one, with inliers below doubted_searched_share
  /// of the points searched; or below doubted_inlier_share of the matches and rough_searched_share of the
  /// points searched.
  double doubted_inlier_share = 0.5;
  double doubted_searched_share = 0.12;
  /// Where dense alignment and the motion so far disagree, both are tried, unless so large a share of the
  /// points searched agrees on a pose already; 0: never. Poses that a passing object gave have up to 0.31.
  double settled_searched_share = 0.35;
  /// A pose from a rough start must explain so much of the points found from it...
  double rough_inlier_share = 0.6;
  double rough_searched_share = 0.2;  ///< ... and of those searched,
  int rough_min_inliers = 40;         ///< and so many points, or
  int rough_min_mapped = 10;          ///< so many that the map has, seen from two places
  int rough_rounds = 3;               ///< searches, each from the pose that the one before gave
  /// While young points are mistrusted: frames in a row in which an immature point must agree to be
  /// confirmed.
  int trusted_after = 3;
  int moving_after = 2;  ///< times in a row that an immature point is found elsewhere: it is said to move
  /// While lost, so long after the last pose, the camera is looked for first where it is if it went on as it
  /// moved [s]; later, if it is within reach of where it then was.
  double coast_for = 1.5;
  /// A pose from a rough start, in metres, may be so far from where the camera would be had it gone on: by
  /// what an acceleration adds [m/s^2], and by what the poses themselves err [m].
  double max_acceleration = 10;
  double reach_slack = 0.5;
  double new_part_after = 1;      ///< lost for so long while corners are seen: a new map part is started [s]
  int new_part_frames = 5;        ///< ... and for so many frames
  int min_corners_seen = 40;      ///< fewer: the lens is covered, or there is nothing to see
  int min_start_points = 40;      ///< with measured depth; a map or map part starts with no fewer, > 0
  int recent_keyframes = 4;       ///< whose images a lost camera is compared with, and depth aligned to
  int depth_patience = 5;         ///< lost frames, beyond which the depth image alone places nothing, >= 0
  double max_alignment_rms = 25;  ///< the dense pose is not trusted above this [grey]

  double keyframe_parallax = 0.09;  ///< |t| since the reference keyframe over the newest one's median depth
  double keyframe_share = 0.65;     ///< of the reference's points still tracked: below it a keyframe is due
  /// A keyframe is due when fewer than 1 - keyframe_empty times as many image regions hold a tracked point as
  /// at the last keyframe.
  double keyframe_empty = 0.5;
  double keyframe_turn = 0.2;  ///< since the last keyframe, where depth alone says how the camera moved [rad]
  /// Share of keyframe_parallax at which a map's second keyframe is due: it confirms the points of the first,
  /// and until then there is no map.
  double young_map_share = 0.2;
  double urgent_share = 0.35;  ///< as keyframe_share; below it a keyframe is due whatever max_pending says
  int max_pending = 2;         ///< with so many proposals on their way to the map no further one is made

  int corner_threshold = 10;    ///< FAST [grey]
  int corner_levels = 3;        ///< levels on which new points are started
  int cell_px = 28;             ///< at most one new point a cell and only where no point is tracked
  int max_new_points = 220;     ///< started in one keyframe
  float min_corner_score = 12;  ///< Shi-Tomasi [grey^2/px^2]
  /// In the dark, with fewer points in view, tracked and started, faint corners will do: half the threshold,
  /// a quarter of the score, where the pyramid has averaged the noise away.
  int scarce_points = 90;
  int max_failures = 4;      ///< immature points not found so many searches in a row are given up
  int max_immature_age = 3;  ///< keyframes after which an immature point is given up

  MonocularStartOptions monocular_start;  ///< one camera only
  FirstStructureOptions first_structure;  ///< likewise
  DepthSeedOptions seeds;                 ///< corners whose depth is not measured
  /// Where most new corners have no depth, a rig that measures it starts some without, as one camera does:
  /// as many as are missing to so many points in view; 0: never.
  int seeded_points = 120;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
