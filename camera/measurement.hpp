#pragma once

#include <Eigen/Core>
#include <cmath>

namespace twofold {

/// Where a rectified rig sees a point, z = (u_l, v_l, u_r)  (thesis eq. 3.8): column and row in the left
/// image and column in the right one, in pixels of pyramid level 0. Where there is no right coordinate u_r is
/// NaN (Rig::kNoRight), in every room; that u_r then weighs nothing follows from it (Rig::information).
using StereoPixel = Eigen::Vector3d;
using StereoPixelF = Eigen::Vector3f;  ///< as it is kept, in the map and in problems

/// Whether a stereo pixel has a right coordinate.
template <class Derived>
[[nodiscard]] bool has_right(const Eigen::MatrixBase<Derived>& z) {
  return !std::isnan(z.z());
}

}  // namespace twofold
