#pragma once

#include "geometry/se3.hpp"
#include "graph/keyframe.hpp"

namespace twofold {

/// Of the scene between two keyframes [m], > 0. Where neither knows its depth, next to nothing: what lies
/// between them is a long way, however short.
[[nodiscard]] double mean_depth(const Keyframe& a, const Keyframe& b);

/// What passes through the view on the way from one keyframe to another: the length moved, in mean depths of
/// the scene, plus the radians turned.
[[nodiscard]] double way_length(const Keyframe& from, const Keyframe& to, const SE3& T_to_from);

/// A way over which one camera's unit of length stays what it is. It drifts by some 2 % times the way's root:
/// over 4 that is twice as much as a keyframe's own place leaves open (DriftOptions::placement_scale).
/// Neighbours that share no points are some 1 apart, the ends of a ring 10 or more.
inline constexpr double kWayOfOneUnit = 4;

}  // namespace twofold
