#pragma once

#include <Eigen/Core>
#include <cmath>

namespace twofold {

/// Whether a measurement z = (u_l, v_l, u_r) has a right coordinate. Where it has none, u_r is NaN
/// (Rig::kNoRight), in every room; that u_r then weighs nothing follows from it (Rig::information).
template <class Derived>
[[nodiscard]] bool has_right(const Eigen::MatrixBase<Derived>& z) {
  return !std::isnan(z.z());
}

}  // namespace twofold
