#pragma once

#include "graph/graph_writer.hpp"

namespace twofold {

/// Brings the parts of keyframes `from` and `to` into one world frame, so that the constraint between them
/// holds exactly: the part with fewer keyframes, or the younger one of two equals, is moved as a whole and
/// takes the other's name. Both keyframes must not be culled. Cost grows with the map, slightly: each
/// keyframe is looked at, those of the smaller part are changed.
/// @return keyframes moved; 0 when both are of one part, and nothing was done
int join_parts(GraphWriter& writer, KeyframeId from, KeyframeId to, const SE3& T_to_from);

}  // namespace twofold
