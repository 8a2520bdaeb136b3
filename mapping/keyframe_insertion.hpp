#pragma once

#include "graph/graph_writer.hpp"
#include "graph/keyframe_proposal.hpp"

namespace twofold {

/// Adds a proposed keyframe, its confirmed points and measurements to the graph, and joins it by an edge to
/// every keyframe that shares at least `theta` points, or to the best one if none does  (thesis 6.2.6). It
/// becomes the reference. Measurements of points the map does not have (any more) are left out.
void insert_keyframe(GraphWriter& writer, const KeyframeProposal& proposal, int theta);

/// Points each other keyframe shares with `id`, ascending by keyframe.
[[nodiscard]] std::vector<std::pair<KeyframeId, int>> covisible_keyframes(const GraphSnapshot& graph,
                                                                          KeyframeId id);

/// Edge from `id` to `other` with the parallax of their present poses, not marginalised.
[[nodiscard]] Edge make_edge(const GraphSnapshot& graph, KeyframeId id, KeyframeId other, int weight);

}  // namespace twofold
