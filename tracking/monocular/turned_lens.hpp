#pragma once

#include <span>

#include "geometry/ransac.hpp"
#include "geometry/se3.hpp"

namespace twofold {

/// What two views say of a camera that only turned, if its calibration has a wrong focal length.
struct TurnedLens {
  double focal_scale = 1;  ///< of the calibration's focal length, with which a rotation explains most
  int explained = 0;       ///< pairs that it brings together
};

/// Through a wrong focal length a rotation is a homography (K R K^-1 with the true camera's K), and a plane
/// explains that as well as any other: only a rotation with a focal length of its own shows that no depth was
/// seen. Tried from 0.4 to 2.5 times the calibration's, then ever finer about the best one.
///
/// @param first, last        the same corners on the planes z = 1 of both views, as the calibration has them
/// @param options.threshold  on these planes, about pixels / focal length
[[nodiscard]] TurnedLens turned_lens(std::span<const Vector3> first, std::span<const Vector3> last,
                                     const RansacOptions& options);

}  // namespace twofold
