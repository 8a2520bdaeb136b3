#pragma once

#include <string>

#include "imaging/corner_selection.hpp"
#include "tracking/monocular/depth_seeds.hpp"

namespace twofold {

/// When a frame becomes a keyframe (tracking/keyframes/keyframe_decision.hpp).
struct KeyframeDecisionOptions {
  double parallax = 0.09;       ///< |t| since the reference keyframe over the newest one's median depth, > 0
  double tracked_share = 0.65;  ///< of the reference's points, in [0, 1]: with fewer still tracked a keyframe
                                ///< is due
  /// A keyframe is due when fewer than 1 - emptied_share times as many image regions hold a tracked point as
  /// at the last keyframe. In [0, 1].
  double emptied_share = 0.5;
  double turn = 0.2;  ///< since the reference keyframe, where depth alone says how the camera moved [rad] > 0
  /// Share of the parallax, in [0, 1], at which a map's second keyframe is due: it confirms the points of the
  /// first, and until then there is no map.
  double young_map_share = 0.2;
  double urgent_share = 0.35;  ///< as tracked_share, in [0, tracked_share]; below it a keyframe is due
                               ///< whatever max_pending says
  int max_pending = 2;         ///< with so many proposals on their way to the map none is made, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// When an older keyframe becomes the reference again (tracking/keyframes/reference_choice.hpp).
struct ReferenceChoiceOptions {
  int interval = 3;           ///< frames between looks for a better reference, >= 1
  int min_gain_percent = 20;  ///< by which it must see more of what is found than the present one, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Where a keyframe starts new points (tracking/keyframes/new_points.hpp).
struct NewPointOptions {
  int corner_threshold = 10;    ///< FAST [grey] >= 1
  int corner_levels = 3;        ///< levels on which points are started, in [1, ImagePyramid::kLevels]
  float min_corner_score = 12;  ///< Shi-Tomasi [grey^2/px^2] >= 0
  int cell_px = 28;             ///< at most one new point a cell and only where no point is tracked, >= 1
  int max_points = 220;         ///< started in one keyframe, >= 1
  int min_start_points = 40;    ///< with measured depth; a map or map part starts with no fewer, >= 1
  /// In the dark, with fewer points in view, tracked and started, faint corners will do, where the pyramid
  /// has averaged the noise away; >= 0.
  int scarce_points = 90;
  FaintCornerOptions faint_corners;
  double cells_per_corner = 2;    ///< of one camera, cells being smaller in small images, > 0
  double min_disparity_px = 0.3;  ///< below it the depth is as good as infinite, > 0
  // Why a stereo pair gives too few depths to start with.
  int max_row_shift = 8;  ///< between left and right image, looked for [rows] >= 0
  int mistake_ratio =
      3;  ///< so many times as many corners with depth the other way: that was the mistake, >= 1
  DepthSeedOptions seeds;  ///< corners whose depth is not measured
  /// Where most new corners have no depth, a rig that measures it starts some without, as one camera does: as
  /// many as are missing to so many points in view, >= 0; 0: never.
  int seeded_points = 120;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// What becomes of points that no snapshot holds yet (tracking/common/immature_points.hpp).
struct ImmaturePointOptions {
  int max_failures = 4;  ///< not found in so many searches in a row, >= 1: given up
  int max_age = 3;       ///< keyframes after which a point is given up, >= 0
  /// While young points are mistrusted: frames in a row in which a point must agree to be confirmed,
  /// in [0, 255].
  int trusted_after = 3;
  int moving_after = 2;  ///< times in a row that a point is found elsewhere, >= 1: it is said to move

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
