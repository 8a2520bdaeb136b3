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
#include "tracking/search/options.hpp"

namespace twofold {

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
  bool starts_maps = true;  ///< false: only localises in a map that was loaded
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
