#pragma once

#include <Eigen/Core>
#include <cmath>

namespace twofold {

/// Where a rectified rig sees a point, z = (u_l, v_l, u_r)  (thesis eq. 3.8): column and row in the left
/// image and column in the right one, in pixels of pyramid level 0. Where there is no right coordinate u_r is
/// NaN (Rig::kNoRight), in every room.
using StereoPixel = Eigen::Vector3d;
using StereoPixelF = Eigen::Vector3f;  ///< as it is kept, in the map and in problems

/// Whether a right coordinate u_r [px] was found.
[[nodiscard]] inline bool has_right(double u_r) {
  return !std::isnan(u_r);
}

/// Whether a stereo pixel has a right coordinate.
template <class Derived>
[[nodiscard]] bool has_right(const Eigen::MatrixBase<Derived>& z) {
  return has_right(static_cast<double>(z.z()));
}

/// Whether u_r counts in an estimate, by the diagonal of the measurement's information [1/px^2]
/// (Rig::information). It does not where there is none, nor where one camera goes on with the map of a rig:
/// that map's measurements have right coordinates, but one camera has no baseline to predict them by. A
/// measurement whose u_r does not count has two components, and its u_r, perhaps NaN, is not even multiplied
/// by zero.
template <class Derived>
[[nodiscard]] bool weighs_right(const Eigen::MatrixBase<Derived>& information) {
  return information.z() > 0;
}

}  // namespace twofold
