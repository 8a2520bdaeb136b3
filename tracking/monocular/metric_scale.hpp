#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "geometry/se3.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

/// Metres a unit of a motion that images alone showed, by the depth images taken with them: at the right
/// scale, what has a depth in one frame looks in the other as it does in its own. Single pixels are compared,
/// because corners need room around them: in a place larger than the camera's reach, a strip along the
/// image's edge may be all that is within it.
///
/// The scale of the least mean difference, of those that move the pixels by so many of them, 0, 1, 2, ..., up
/// to a share of the image; then Gauss-Newton in that one unknown. Allocates; its work is bounded by the
/// image's size.
/// @param a, b   frames of a depth camera (rig.kind is kRgbd)
/// @param T_b_a  its translation in any unit
/// @return  nothing where too few pixels tell, they hardly move, or another scale explains them about as well
[[nodiscard]] std::optional<double> metric_scale(const Rig& rig, const FrameImages& a, const FrameImages& b,
                                                 const SE3& T_b_a);

}  // namespace twofold
