#pragma once

#include <optional>

#include "imaging/image_pyramid.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

/// A corner of an earlier frame, followed from frame to frame.
struct FollowedCorner {
  PointAppearance appearance;             ///< in the frame it is a corner of
  Eigen::Vector2f uv{0, 0};               ///< level-0 pixel in the newest frame that had it
  std::optional<Eigen::Vector2f> motion;  ///< between the last two frames, the prediction of the next [px]
};

/// Finds a corner of the previous frame in the current one: coarse to fine, patches of the previous frame
/// (Lucas-Kanade on a pyramid; near the border from the coarsest level on that the patch lies in), and at
/// last the patch of the corner's own frame, so that errors do not add up. No allocation, bounded work.
///
/// @return false when it is not found; the corner is then as it was
[[nodiscard]] bool follow_corner(const ImagePyramid& previous, const ImagePyramid& current,
                                 FollowedCorner& corner);

}  // namespace twofold
