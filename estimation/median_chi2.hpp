#pragma once

namespace twofold {

/// Median of chi-square.
/// @param dof  degrees of freedom of a measurement: 2, or 3 with a right coordinate
[[nodiscard]] constexpr double median_chi2(int dof) {
  return dof == 2 ? 1.386 : 2.366;
}

}  // namespace twofold
