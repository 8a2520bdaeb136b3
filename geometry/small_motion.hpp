#pragma once

#include "geometry/types.hpp"

namespace twofold {

/// exp(xi) x of a small motion xi = (v, omega), by its series  (the closed form of thesis eq. 2.70 - 2.72
/// takes several times as long, of which the sine and cosine are most). Six terms are exact to rounding where
/// |omega| < 0.1, and at 0.5 rad wrong by 2e-6 of what x moves by; two are wrong by |omega|^2 / 6 of it.
template <int kTerms = 6>
[[nodiscard]] Vector3 moved_by(const Vector6& xi, const Vector3& x) {
  const Vector3 omega = xi.tail<3>();
  Vector3 term = xi.head<3>() + omega.cross(x);
  Vector3 sum = x + term;
  for (int n = 2; n <= kTerms; ++n) {
    term = (1.0 / n) * omega.cross(term);
    sum += term;
  }
  return sum;
}

}  // namespace twofold
