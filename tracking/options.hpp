#pragma once

#include <string>

#include "imaging/guided_search.hpp"
#include "imaging/right_rows.hpp"
#include "tracking/common/dense_alignment.hpp"
#include "tracking/depth/options.hpp"
#include "tracking/fixed/fixed_pixels.hpp"
#include "tracking/keyframes/options.hpp"
#include "tracking/loss/options.hpp"
#include "tracking/monocular/options.hpp"
#include "tracking/motion/options.hpp"
#include "tracking/pose/options.hpp"

namespace twofold {

/// Which points of the map are searched in a frame (tracking/search/local_map_search.hpp).
struct LocalMapSearchOptions {
  int wanted_matches = 180;      ///< stop searching once so many points were found, in [1, max_searches]
  int max_searches = 320;        ///< upper bound of points searched, >= 1
  int neighbour_keyframes = 20;  ///< the reference keyframe's: so many, those that share most points, >= 1
  double border_px = 8;          ///< points predicted closer to the image's edge are not searched, >= 0
  double min_view_cosine = 0.7;  ///< of the angle between a point's first ray and today's, in [-1, 1]
  double lost_radius_px = 8;     ///< search radius while lost, > 0
  /// The light has changed when so large a share of the points searched was missed, in (0, 1] ...
  double light_missed_share = 0.5;
  int min_light_points = 15;  ///< ... of which so many say by how much the light changed, >= 1 ...
  double light_change = 1.5;  ///< ... and the view is by so much brighter or darker there, > 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// By how much each level of effort bounds a frame's work (EffortLevel); each level's bounds hold for those
/// below it, too.
struct EffortBoundsOptions {
  double points_share = 0.5;          ///< of wanted_matches and max_searches, in (0, 1]
  int coarse_levels = 2;              ///< so many above the finest, dense alignment stops, >= 0
  double iterations_share = 1.0 / 3;  ///< of the solver's and the patch search's, in (0, 1]
  int min_motion_iterations = 2;      ///< of the solver, whatever that share is, >= 1
  int min_refine_iterations = 1;      ///< of the patch search, likewise

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Of the tracker, in the order in which a frame meets them.
struct TrackerOptions {
  EffortBoundsOptions effort;
  RightRowsOptions right_rows;  ///< stereo only
  FixedPixelOptions fixed;
  MotionModelOptions motion_model;
  ShutterOptions shutter;
  DenseAlignmentOptions alignment;
  GuidedSearchOptions search;  ///< of one point
  LocalMapSearchOptions local_map;
  PoseOptions pose;
  DepthPlacementOptions depth;
  LossOptions loss;
  MonocularStartOptions monocular_start;  ///< one camera only
  KeyframeDecisionOptions keyframes;
  ReferenceChoiceOptions reference;
  NewPointOptions new_points;
  ImmaturePointOptions immature;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
