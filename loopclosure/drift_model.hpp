#pragma once

#include <string>
#include <vector>

#include "camera/rig.hpp"
#include "geometry/sim3.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// How motion drifts that is estimated from one keyframe to the next: standard deviations. Lengths are
/// counted in median depths of the scene, by which a camera drifts alike everywhere; the way is that, plus
/// the radians turned: what has passed through the view.
struct DriftOptions {
  // Of a keyframe alone, whatever the way: it may be placed badly.
  double placement = 0.1;         ///< [depths] > 0
  double placement_deg = 5;       ///< [degrees] > 0
  double placement_scale = 0.02;  ///< of the logarithm of the scale, > 0
  // Of chance: they grow with the root of the way.
  double shift = 0.05;      ///< [depths] > 0
  double turn_deg = 0.2;    ///< [degrees] > 0
  double log_scale = 0.02;  ///< of one camera, > 0
  // Of the calibration: alike everywhere, so that they grow with the way, and cancel where turns do.
  double length_gain = 0.03;             ///< share of all lengths, >= 0
  double turn_gain = 0.02;               ///< share of all turns, >= 0
  double turn_gain_of_one_camera = 0.1;  ///< whose focal length may be wrong by a fifth, >= 0
  double log_scale_gain = 0.007;         ///< of one camera: logarithm of the scale per way, >= 0
  // Keyframes so near to each other make one step of the way: what a head or a car nods is no turn.
  double step_distance = 1;  ///< [depths] > 0
  double step_turn = 0.3;    ///< [rad] > 0
  double max_chi2 = 24.3;    ///< 99.9 % of chi-square with 7 degrees of freedom, > 0; where the scale is
                             ///< known 6 count, and it is 99.95 %

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Whether a camera can have drifted from where the map has it to where a loop says that it is.
///
/// Between the two keyframes lie steps D_i of the map. Their errors xi_i have mean zero and the deviations of
/// DriftOptions: some of chance, drawn for each step, some of the calibration, common to all. The most
/// probable ones with which the steps lead where the loop says,
///
///   exp(pi) exp(xi_n) D_n ... exp(xi_1) D_1  =  S_to_from,
///
/// pi by how much the last keyframe is placed badly, are found by Gauss-Newton, and their squared Mahalanobis
/// distance is compared with max_chi2. So shift, rotation and scale must follow from each other: who says
/// that a street has turned by 60 degrees must also say where its end has gone.
class DriftModel {
 public:
  DriftModel(SensorKind sensor, const DriftOptions& options);

  /// Cost grows with the keyframe ids between the two, culled ones included.
  /// @param from, to   keyframes of one part of the map, `to` not culled
  /// @param S_to_from  p_to = S_to_from * p_from, lengths around `to` in its own unit
  [[nodiscard]] bool explains(const GraphSnapshot& graph, KeyframeId from, KeyframeId to,
                              const Sim3& S_to_from) const {
    return chi2(graph, from, to, S_to_from) <= options_.max_chi2;
  }
  /// The squared Mahalanobis distance; infinite where no bending of the way leads there.
  [[nodiscard]] double chi2(const GraphSnapshot& graph, KeyframeId from, KeyframeId to,
                            const Sim3& S_to_from) const;

 private:
  using Matrix73 = Eigen::Matrix<double, 7, 3>;

  /// From one place of the way to the next.
  struct Step {
    SE3 D;                         ///< p_next = D * p_before, as the map has it
    Vector7 variance;              ///< of chance
    Matrix73 calibration;          ///< error by the gains of length, turn and scale
    Vector7 xi = Vector7::Zero();  ///< error found
  };

  [[nodiscard]] std::vector<Step> steps_between(const GraphSnapshot& graph, KeyframeId from,
                                                KeyframeId to) const;
  [[nodiscard]] Step step(const SE3& D, double distance, double depth) const;
  [[nodiscard]] Vector7 variance(double shift, double turn_deg, double log_scale, double depth) const;
  /// Errors of the steps, and of the last keyframe's placement, for which they lead to S_to_from to first
  /// order. @return their squared Mahalanobis distance
  [[nodiscard]] double bend(std::vector<Step>& steps, Vector7& placement, const Vector7& placement_variance,
                            const Sim3& S_to_from) const;

  DriftOptions options_;
  Vector3 gain_variance_;  ///< of the gains of length, turn and scale
  double log_scale_;       ///< 0 where the scale cannot drift
};

}  // namespace twofold
