#pragma once

#include <string>

#include "graph/snapshot.hpp"

namespace twofold {

/// Empty when the graph is sound; otherwise names the first thing that is not:
/// observations ascending, each with its observer entry and the other way round; edges ascending, symmetric
/// and equal but for direction; nothing hangs off culled keyframes or culled points; heirs that are known end
/// at a keyframe that stayed; those of points' anchors are known, and the points rightly counted; an anchor
/// that stayed observes its points; points alive have positive inverse depth and at least `min_observers`.
[[nodiscard]] std::string broken_invariant(const GraphSnapshot& graph, std::size_t min_observers = 0);

/// Culled keyframes whose heirs are not forgotten, and those of them that points are anchored in.
[[nodiscard]] std::size_t known_heirs(const GraphSnapshot& graph);
[[nodiscard]] std::size_t culled_anchors(const GraphSnapshot& graph);

/// Number of connected components among the keyframes that are not culled.
[[nodiscard]] int component_count(const GraphSnapshot& graph);

}  // namespace twofold
