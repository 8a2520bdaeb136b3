#pragma once

#include <optional>
#include <string>

#include "imaging/image_pyramid.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

struct CornerFollowingOptions {
  int coarsest_level = 3;  ///< patches of coarser ones cover what moves differently,
                           ///< in [0, ImagePyramid::kLevels - 1]
  int first_radius_px =
      8;  ///< searched on the coarsest level for a corner whose motion is not known [its px] >= 1
  int coarse_radius_px = 4;  ///< ... and for one whose motion is known, >= 1
  int radius_px = 2;         ///< around what a coarser level said [px of the level] >= 1
  /// Bounds the work where no coarser level could be searched [px of the level], >= radius_px.
  int max_radius_px = 12;
  int max_iterations = 12;  ///< of sub-pixel alignment, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

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
                                 const CornerFollowingOptions& options, FollowedCorner& corner);

}  // namespace twofold
