#pragma once

#include <vector>

#include "graph/graph_writer.hpp"
#include "graph/map_file.hpp"

namespace twofold {

/// Names each keyframe's part (Keyframe::part) after the oldest keyframe it is connected with: for a graph
/// that comes without names. Cost grows with the map.
void name_parts(GraphWriter& writer);

/// Names of the parts that have keyframes which were not culled, ascending.
[[nodiscard]] std::vector<KeyframeId> parts_of(const GraphSnapshot& graph);

/// The part of the oldest keyframe that was not culled, which a loaded map's are before new ones; kNoKeyframe
/// in an empty graph.
[[nodiscard]] KeyframeId oldest_part(const GraphSnapshot& graph);

/// A map of one part alone: its keyframes, those that were culled only if a point is anchored in them, and
/// points, numbered anew from 0 in the same order, and their places. The reference is kept, or, when it is of
/// another part, its newest keyframe becomes it.
[[nodiscard]] SavedMap extract_part(const Rig& rig, const GraphSnapshot& graph,
                                    const KeyframeDatabase& places, KeyframeId part);

}  // namespace twofold
