#pragma once

#include <tl/expected.hpp>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "tracking/common/lost_cause.hpp"

namespace twofold {

struct FirstStructureOptions {
  double threshold_px = 1.0;        ///< of pairs that an epipolar geometry explains, > 0
  double rotation_px = 1.5;         ///< of pairs that a rotation or a plane explains, > 0
  double sigma_px = 0.7;            ///< standard deviation of a followed corner, > 0
  double min_flow_px = 4;           ///< median motion in the image, below which nobody has moved, >= 0
  int min_points = 45;              ///< of the first map, >= 5
  double min_share = 0.6;           ///< of the corners that agree with the motion, in (0, 1]
  double max_rotation_share = 0.5;  ///< of those that a rotation explains as well, in (0, 1]
  double max_depth_error =
      0.1;                ///< of inverse depth, as a share of it, of the nearest corners (near_share), > 0
  int max_samples = 120;  ///< of RANSAC, >= 1
  double max_behind_share = 0.1;  ///< of the depths beyond noise, that may have the wrong sign, in [0, 1]
  double min_plane_share = 0.6;   ///< of those that moved: a homography explains so many, so that two motions
                                  ///< are asked, in [0, 1]
  double decisive_chi2 = 32;      ///< by which one motion must explain all better than another, >= 0
  double hopeless_ratio = 1.5;    ///< after the rough adjustment, of a motion's cost over the best one's,
                                  ///< beyond decisive_chi2: such a one is not adjusted any further, >= 1
  double finest_sigma = 0.35;  ///< times sigma_px: no corner is followed more exactly, on the sharpest image,
                               ///< in (0, 1]
  double max_point_error = 0.25;  ///< of inverse depth, as a share of it, of a point that joins the map, > 0
  double near_share = 0.3;  ///< of the corners, the nearest, that max_depth_error is of: those far off veto
                            ///< nothing, in (0, 1]
  /// Of the corners, that stand still where the motion would have moved them: more say that the camera
  /// stands, and something moves before it, in [0, 1] ...
  double max_still_share = 0.08;
  /// ... unless they lie in a strip of so much of the image's height, as a bonnet or a caption does:
  /// in [0, 1].
  double fixed_strip = 0.3;
  double significant_sigmas = 2;  ///< of a depth, from which on its sign counts, >= 0
  double gross_chi2 = 50;  ///< beyond this before the adjustment, a corner follows something else, > 0 ...
  double outlier_chi2 = 9.21;  ///< ... and after: 99 % of chi-square with 2 degrees of freedom, > 0
  int adjustment_steps = 15;   ///< at most, >= 1
  /// Of the squared whitened errors, with less of which an adjustment ends, > 0: the first one only tells
  /// gross errors.
  double first_gain = 1;
  double min_gain = 0.01;
  // Motions that differ by less are one: cosine between directions, in [-1, 1], and angle [rad] >= 0.
  double same_direction = 0.95;
  double same_angle = 0.02;
  // Where nobody knows how fast rows are read.
  double shear_quantile = 0.9;  ///< of the corners' shear, by which readouts are told apart, in (0, 1]
  int max_readouts = 32;        ///< tried, >= 1: bounds the work

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Corners followed through some frames of one camera, in step with each other: level-0 pixels in the first
/// frame, in one or more between, in their order, and in the last.
struct CornerViews {
  std::vector<Vector2> first, last;
  std::vector<std::vector<Vector2>> between;
  /// How far each corner moved from the first frame to the next one, and from the one before to the last
  /// [px], where rows may be read one after the other, nobody knows how fast. Empty: the pixels are those of
  /// a global shutter.
  std::vector<Vector2> first_motion, last_motion;
};

/// What the frames show of camera and scene, in a unit of its own: the median depth of the points is one.
struct FirstStructure {
  SE3 T_last_first;
  std::vector<int> corners;  ///< those that have a depth
  std::vector<Vector3> psi;  ///< inverse depth coordinates in the first frame, of `corners`
};

/// The start of a map from one moving camera: essential matrix (five points) beside the rotation and the
/// homography that explain the same corners.
///
/// Most of what the essential matrix explains must be beyond any rotation: a camera that turns on the spot
/// gives no depth, and of a standing one before which something moves, most corners stand. If it hides most
/// of the view, they tell by standing still where this motion would have moved them. A rolling shutter shears
/// views in which the camera turns at different rates, and a motion that is none explains that: where its
/// readout is not known, most must be beyond any rotation through any readout. Where a homography explains
/// about as much, the scene may be a plane, of which two motions give the same first and last view: its
/// motions are tried beside that of the essential matrix. All frames decide, because the views of a third one
/// from elsewhere fit only the true motion; where two fit them all, the start has to wait. A motion that
/// cannot win any more after a rough adjustment is given up. Depths are those of a bundle adjustment of all
/// frames (thesis 4.5.3). Points so far away that they may be behind infinity by noise neither vote nor veto.
///
/// Deterministic. Allocates; its work is bounded by the number of corners and max_samples.
/// @return  otherwise why not: kTooFewCorners, kTooLittleParallax, kRotatingOnly, kNoCommonMotion,
///          kPlaneUndecided
[[nodiscard]] tl::expected<FirstStructure, LostCause> first_structure(const Rig& rig,
                                                                      const CornerViews& views,
                                                                      const FirstStructureOptions& options);

}  // namespace twofold
