#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"
#include "imaging/point_appearance.hpp"

namespace twofold {

struct GuidedSearchOptions {
  double radius_px = 3;  ///< search radius around the prediction, in pixels of the searched level
  double max_mean_difference =
      18;  ///< after removing mean brightness: mean absolute grey difference of a match, > 0
  int refine_iterations = 10;  ///< upper bound of sub-pixel Lucas-Kanade steps
  double right_search_px = 8;  ///< stereo: half range along the row around the predicted u_r, level pixels
};

struct PointMatch {
  Vector3 z;     ///< (u_l, v_l, u_r) level-0 pixels; u_r is Rig::kNoRight if it was not found
  int level;     ///< pyramid level of the match: its standard deviation is about sigma_0 * 2^level
  double score;  ///< mean absolute grey difference of the match, brightness removed
};

/// Looks for a known point in a new view: warps its patch to the view, compares it within a small radius (at
/// corners or everywhere), refines to sub-pixel, and finds it in the right image along the row (or reads the
/// depth image). Thesis 3.4.2 and 6.3. No allocation, bounded work.
///
/// @param psi    inverse depth coordinates of the point in its anchor frame
/// @param T_c_a  pose of the view relative to the anchor: x_c = T_c_a x_a  [m]
/// @return nothing when the point is behind or outside the view, seen at a too different scale, or not found.
[[nodiscard]] std::optional<PointMatch> find_point(const FrameImages& images, const Rig& rig,
                                                   const PointAppearance& appearance, const Vector3& psi,
                                                   const SE3& T_c_a, const GuidedSearchOptions& options);

}  // namespace twofold
