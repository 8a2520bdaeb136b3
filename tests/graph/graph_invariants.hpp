#pragma once

#include <string>

#include "graph/snapshot.hpp"

namespace twofold {

/// Empty when the graph is sound; otherwise names the first thing that is not:
/// observations ascending, each with its observer entry and the other way round; edges ascending, symmetric
/// and equal but for direction; nothing hangs off culled keyframes or culled points; heirs end at a keyframe
/// that stayed; an anchor that stayed observes its points; points alive have positive inverse depth and at
/// least `min_observers`.
[[nodiscard]] std::string broken_invariant(const GraphSnapshot& graph, std::size_t min_observers = 0);

/// Number of connected components among the keyframes that are not culled.
[[nodiscard]] int component_count(const GraphSnapshot& graph);

}  // namespace twofold
