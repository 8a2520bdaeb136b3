#pragma once

#include <span>
#include <string>
#include <vector>

#include "geometry/types.hpp"

namespace twofold {

/// One point seen from two places, position and covariance in each place's own frame [m, m^2].
struct PointMatch3d {
  Vector3 x_0, x_1;
  Matrix3 covariance_0 = Matrix3::Zero(), covariance_1 = Matrix3::Zero();
};

struct ConsistencyOptions {
  double threshold = 0.02;  ///< theta_C: distances that differ by less agree in any case [m], >= 0
  double sigmas = 3;        ///< ... and by less than so many standard deviations of the difference, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Moravec's consistency check  (SWF 4.1.1): whatever the motion, a rigid body keeps the distances between
/// its points. Matches a and b agree when | |x_0a - x_0b| - |x_1a - x_1b| | is small; the answer is the
/// maximal clique of agreeing matches that grows greedily around the match with most agreements, always by
/// the one that keeps most candidates. Finds the largest rigid part of the scene even below one half of the
/// matches.
///
/// The threshold grows with the uncertainty of the two distances (Hirschmueller et al. 2002): at long range a
/// fixed one in metres would leave near points only.
///
/// @return  indices of the clique, ascending; empty without matches. Equal candidates: the first one wins.
/// O(n^2) time and bits.
[[nodiscard]] std::vector<int> consistent_matches(std::span<const PointMatch3d> matches,
                                                  const ConsistencyOptions& options);

}  // namespace twofold
