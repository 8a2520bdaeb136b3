#pragma once

#include "geometry/types.hpp"

namespace twofold {

/// How differently a point is seen from two places; patches are found again when both are near 1.
struct ViewChange {
  double cosine = 1;  ///< of the angle between the two rays
  double ratio = 1;   ///< distance from the first place over that from the second

  /// @param from_first, from_second  from each place to the point, in axes of the same direction [m]
  static ViewChange between(const Vector3& from_first, const Vector3& from_second) {
    const double first = from_first.norm(), second = from_second.norm();
    return {from_first.dot(from_second) / (first * second), first / second};
  }
};

}  // namespace twofold
