#pragma once

#include <string>

#include "estimation/window_problem.hpp"

namespace twofold {

struct MapperOptions {
  int inner_window = 25;             ///< M1: keyframes optimised over points, >= 2  (thesis 6.2.3)
  int outer_window = 175;            ///< M2: keyframes held by relative poses
  bool global_outer_window = false;  ///< gDWO: the outer window is all the rest of the map
  int theta = 15;                    ///< points two keyframes must share to be joined by an edge  (6.2.6)

  int structure_iterations = 3;  ///< points alone, before the joint solve
  WindowSolverOptions solver{.max_iterations = 4, .huber_px = 2.0};
  double outlier_chi2_mono =
      9.0;  ///< measurements above it are removed after the solve (2 degrees of freedom)
  double outlier_chi2_stereo = 11.0;  ///< the same with right coordinate (3 degrees of freedom)

  /// eq. 6.2: information of a relative pose by which w shared points hold two keyframes,
  /// w diag(lambda_trans^2 I, lambda_rot^2 I), in units of what one point of one pixel noise gives:
  /// lambda_rot = share f, lambda_trans = share f / depth. The share is well below one because the points
  /// themselves are uncertain.
  double constraint_share = 0.3;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
