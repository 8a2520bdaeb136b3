#pragma once

#include <optional>
#include <vector>

#include "estimation/reduced_system.hpp"
#include "estimation/window_problem.hpp"

namespace twofold {

/// Covariance of poses and points of a window at its present values: blocks of (J^T W J)^-1, W the
/// information times the weight of the robust kernel  (thesis 3.3.4).
///
/// Needs a gauge: at least one fixed pose (and for a monocular window a second one, or a constraint that
/// knows the scale). Poses are covered as left perturbations, T = exp(delta) T_k_w, tangent order (v, omega).
/// With pose j fixed, the covariance of pose i is that of the relative pose T_i_j.
class WindowCovariance {
 public:
  /// Nullopt when the poses are not determined by the observations and constraints. The problem must be
  /// valid.
  [[nodiscard]] static std::optional<WindowCovariance> compute(const WindowProblem& problem,
                                                               const WindowSolverOptions& options);

  /// Zero for a pose that is fixed; nullopt for one that nothing is known about.
  [[nodiscard]] std::optional<Matrix6> pose(int i) const { return poses(i, i); }
  /// Cross-covariance of delta_i and delta_j, the rows belong to i.
  [[nodiscard]] std::optional<Matrix6> poses(int i, int j) const;
  /// Covariance of psi, jointly with all poses; nullopt for a point without usable observations.
  [[nodiscard]] std::optional<Matrix3> point(int k) const;

 private:
  WindowCovariance() = default;

  ReducedSystem system_;
  std::vector<RigidMotion> relative_;
  std::vector<char> fixed_;  // by pose
  std::vector<int> group_of_track_;
  std::vector<int> track_of_point_;  // -1: not used
};

}  // namespace twofold
