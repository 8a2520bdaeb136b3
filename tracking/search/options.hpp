#pragma once

#include <string>

#include "imaging/corner_selection.hpp"
#include "tracking/monocular/depth_seeds.hpp"

namespace twofold {

/// Which points of the map are searched in a frame (tracking/search/local_map_search.hpp).
struct LocalMapSearchOptions {
  int wanted_matches = 180;      ///< stop searching once so many points were found, in [1, max_searches]
  int max_searches = 320;        ///< upper bound of points searched, >= 1
  int neighbour_keyframes = 20;  ///< the reference keyframe's: so many, those that share most points, >= 1
  double border_px = 8;          ///< points predicted closer to the image's edge are not searched, >= 0
  double min_view_cosine = 0.7;  ///< of the angle between a point's first ray and today's, in [-1, 1]
  double lost_radius_px = 8;     ///< search radius while lost, > 0
  // A ray is searched as long as its depth hardly matters:
  double max_ray_px = 3;           ///< moved in the image by a standard deviation of it, > 0,
  double max_ray_parallax = 0.05;  ///< and seen from less far away than this share of its likely depth, > 0
  /// The light has changed when so large a share of the points searched was missed, in (0, 1] ...
  double light_missed_share = 0.5;
  int min_light_points = 15;  ///< ... of which so many say by how much the light changed, >= 1 ...
  double light_change = 1.5;  ///< ... and the view is by so much brighter or darker there, > 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Where a keyframe starts new points (tracking/search/point_starter.hpp, tracking/keyframes/new_points.hpp).
struct NewPointOptions {
  int corner_threshold = 10;    ///< FAST [grey] >= 1
  int corner_levels = 3;        ///< levels on which points are started, in [1, 3]
  float min_corner_score = 12;  ///< Shi-Tomasi [grey^2/px^2] >= 0
  int cell_px = 28;      ///< at most one new point a cell and only where no point is tracked, a multiple of 4
  int max_points = 220;  ///< started in one keyframe, >= 1
  int min_start_points = 40;  ///< with measured depth; a map or map part starts with no fewer, >= 1
  /// Of a depth camera, with fewer points in view, tracked and started, where most corners have no depth:
  /// a cell whose best corner has none may have another one that has, and is parted, >= 0; 0: never.
  int crowded_below = 90;
  int small_cell_px = 12;  ///< a multiple of 4; never above cell_px
  /// In the dark, with fewer points in view, tracked and started, faint corners will do, where the pyramid
  /// has averaged the noise away; >= 0.
  int scarce_points = 90;
  FaintCornerOptions faint_corners;
  /// One camera: with fewer points of known depth found, corners whose depth is not known yet carry the
  /// camera's rotation, >= 0 ...
  int rays_below = 40;
  double rays_within =
      0.04;  ///< ... while it moves by less than this share of the depth from frame to frame, > 0
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

}  // namespace twofold
