#pragma once

#include "base/check.hpp"

namespace twofold {

/// Median of chi-square with so many degrees of freedom: 2 of a pixel, 3 with a right coordinate, 6 of a pose
/// or plane.
[[nodiscard]] constexpr double median_chi2(int dof) {
  TWOFOLD_CHECK(dof == 2 || dof == 3 || dof == 6, "medians of chi-square that are known");
  return dof == 2 ? 1.386 : dof == 3 ? 2.366 : 5.346;
}

}  // namespace twofold
