#pragma once

#include <functional>
#include <vector>

#include "graph/graph_writer.hpp"
#include "graph/id_map.hpp"
#include "graph/neighbourhood.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// W1 and W2 around a reference keyframe  (thesis 6.2.3).
///
/// `nodes` is a spanning tree rooted at the reference, parents before children: first the inner window, then
/// the outer one, its last nodes anchors of inner points that were not met on the way  (6.2.4).
struct DoubleWindow {
  std::vector<TreeNode> nodes;
  std::size_t inner = 0;  ///< nodes[0, inner) are W1, the rest W2
  IdMap position;         ///< of a keyframe in nodes

  [[nodiscard]] bool contains(KeyframeId id) const { return position.contains(id); }
  [[nodiscard]] bool is_inner(int at) const { return at >= 0 && static_cast<std::size_t>(at) < inner; }
  [[nodiscard]] bool is_inner(KeyframeId id) const { return is_inner(position.find(id)); }
  /// Brings `position` up to date with `nodes`.
  void number_nodes();
};

/// All keyframes of a spanning tree as an inner window; the outer one is empty.
[[nodiscard]] DoubleWindow inner_window_of(std::vector<TreeNode> tree);

/// Scratch kept between rounds.
struct SelectionScratch {
  VisitedSet visited;
  IdMap met_anchors;
};

/// Weighted breadth-first selection of both windows, and of the anchors that may join: those with a direct
/// edge to a frame of W1, so that they are still accurately defined. W2 keeps its size: an anchor takes the
/// place of the member met last that is no anchor itself, and stays out if there is none. Costs O(window).
void select_double_window(const GraphSnapshot& graph, const MapperOptions& options, SelectionScratch& scratch,
                          DoubleWindow& window);

/// Marginalisation when W1 moves on: an edge within the old inner window that is not within the new one gets
/// the present relative pose as its constraint. So does any other edge that would otherwise depend on
/// absolute poses that are no longer optimised together. Afterwards an edge without a constraint of its own
/// has an end in W1 and both ends in the double window.
/// @param leaves  if set, is called for every such edge before it gets its constraint
/// @return  number of edges
int marginalise_left_edges(GraphWriter& writer, const DoubleWindow& before, const DoubleWindow& now,
                           const std::function<void(KeyframeId from, KeyframeId to)>& leaves = {});

/// The same as if W1 had left every keyframe: all edges without a constraint of their own get one. Poses that
/// such an edge joins must agree. Cost grows with the map.
/// @return  number of edges
int marginalise_all_edges(GraphWriter& writer);

/// Every edge within the window gets the present relative pose as its constraint, those that have one as
/// well.
void marginalise_edges_of(GraphWriter& writer, const DoubleWindow& window);

/// Window entry, eq. 6.3: the poses of keyframes outside of `consistent`, and of all their children in the
/// spanning tree, are set along the relative poses of the tree's edges. If the edges of a loop contradict
/// each other, the contradiction thus appears at the rim of the window and not near the reference. Returns
/// the number of poses set.
int enter_window(GraphWriter& writer, const IdMap& consistent, const DoubleWindow& window);

}  // namespace twofold
