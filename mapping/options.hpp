#pragma once

#include <memory>
#include <string>

#include "estimation/pose_consensus.hpp"
#include "estimation/window_problem.hpp"
#include "graph/way_length.hpp"

namespace twofold {

class MapperHook;

/// Eq. 6.2: Lambda = w diag(lambda_trans^2 I, lambda_rot^2 I); see edge_information.
struct EdgeInformationOptions {
  double trans_share = 0.1;  ///< share of the ideal translational precision an edge gets, > 0
  double rot_share = 0.1;    ///< share of the ideal rotational precision an edge gets, > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Metric loop closure  (6.4.1).
struct MetricLoopOptions {
  bool enabled = true;
  int neighbourhood = 100;       ///< |N2|: nearest members of the double window whose points are tried, >= 0
  int max_searches = 240;        ///< points searched in one round, spread over the image's cells, >= 0
  int columns = 8;               ///< cells of the image for that, >= 1
  int rows = 6;                  ///< likewise
  double search_radius_px = 10;  ///< > 0
  double max_error_px = 1;       ///< of points that agree with T_loop, on their pyramid level, > 0
  double border_px = 10;         ///< predictions closer to the image's edge are not searched, >= 0
  /// Of the angle between the anchor's and the reference's ray to a point, in [-1, 1]: a patch is found again
  /// up to some 50 degrees.
  double min_view_cosine = 0.6216;
  /// From the reference to a member of N2 (way_length), of one camera whose scale drifts, > 0.
  double max_way_of_one_camera = kWayOfOneUnit;
  /// Of min_covisible: so many matches in the upper, lower, left and right half of the reference's image, in
  /// [0, 1].
  double min_half_share = 0.5;
  PoseConsensusOptions consensus;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct CullingOptions {
  bool keyframes = true;
  bool points = true;
  double redundant_share = 0.9;  ///< of a keyframe's points that others see as well, in (0, 1]
  int redundant_observers = 3;   ///< other keyframes that must see such a point, as finely, >= 2
  int keep_recent = 8;           ///< newest keyframes are never culled, >= 0
  int max_keyframes = 2;         ///< culled in one round for each that it inserted, >= 0
  /// Keyframes culled last whose replacements stay known, >= max_keyframes. Tracker and loop closer may refer
  /// to a keyframe for as long as a message is under way between the threads: the time in which some tens of
  /// keyframes are inserted, for each of which max_keyframes are culled at most.
  int keep_replacements = 128;
  int max_misses =
      8;  ///< keyframes in a row a weak point should have been seen from and was not, in [1, 255]
  // A keyframe should have seen a point that projects this far inside of its image [px], and whose patch
  // looks there much as it did from the anchor: nearly the same direction and distance.
  double view_border_px = 30;     ///< >= 0
  double min_view_cosine = 0.9;   ///< of the angle between both rays, in [-1, 1]
  double max_scale_change = 1.5;  ///< ratio of both distances, either way, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Bundle adjustment of the whole map at the end of a run.
struct GlobalAdjustmentOptions {
  bool enabled = true;
  int max_keyframes = 5000;  ///< maps of more keep what windows and pose graph gave them, >= 0
  int max_iterations = 10;   ///< Levenberg-Marquardt steps a round, accepted or not, >= 1
  int rounds = 2;            ///< after each, what disagrees is removed, >= 1
  // Instead of those of WindowSolverOptions: what bends a long way, or changes its unit from one end to the
  // other, hardly changes the cost, of which a large map has much. It takes steps that are hardly damped, and
  // all of them.
  double initial_damping = 1e-8;    ///< >= 0
  double relative_decrease = 1e-9;  ///< >= 0
  /// What no statistics see of the focal length that a map of one camera shows, as a share of it, > 0, as in
  /// SelfCalibrationOptions::systematic_sigma. Where statistics see more than this, the map does not show it.
  double focal_sigma = 0.01;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

struct MapperOptions {
  int inner_window = 25;            ///< M1 >= 1: keyframes joined by point-pose constraints  (6.2.3)
  int outer_window = 175;           ///< M2 >= 0: keyframes joined by pose-pose constraints (cDWO), anchors
                                    ///< included; so many that all fit (gDWO): all the rest of the map
  int max_anchors = 25;             ///< anchors that may take places of W2 for their points, >= 0  (6.2.4)
  int max_points = 5000;            ///< in one problem, >= 1; those with the fewest measurements stay out
  double min_inverse_depth = 1e-5;  ///< [1/m] > 0; farther points say nothing about translation
  double nearest = 1e-3;            ///< of the median depth of the keyframe that sees a point, >= 0: nearer
                                    ///< ones are mistakes
  int min_covisible = 15;           ///< Theta >= 1: covisible points that make an edge, 15 to 30
  EdgeInformationOptions edge;
  WindowSolverOptions solver;  ///< joint optimisation of eq. 6.4
  /// With one camera solver.relative_decrease is at least this, >= 0. Of thousands of measurements, a step
  /// that gains so little of the cost moves the window by less than their noise does, the next one gains a
  /// tenth or a hundredth of that, and the next keyframe's round goes on from there. A rig's frames may be so
  /// far apart that this round would begin too far off.
  double one_camera_decrease = 3e-4;
  int structure_iterations = 2;        ///< structure-only, after poses were set along edges, >= 0
  double outlier_chi2_mono = 10.6;     ///< 99.5 % of chi-square with 2 degrees of freedom, > 0
  double outlier_chi2_stereo = 12.84;  ///< 99.5 % of chi-square with 3 degrees of freedom, > 0
  MetricLoopOptions loop;
  CullingOptions culling;
  GlobalAdjustmentOptions global;
  std::shared_ptr<MapperHook> hook;  ///< an experiment's; null: none

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
