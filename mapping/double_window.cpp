#include "mapping/double_window.hpp"

#include <algorithm>
#include <utility>

#include "mapping/edges.hpp"

namespace twofold {
namespace {

/// Position in W1 of the keyframe with the strongest edge to `id`; -1 if there is none.
int strongest_inner_neighbour(const GraphSnapshot& graph, const DoubleWindow& window, KeyframeId id) {
  int best = -1, best_weight = -1;
  for (const Edge& edge : *graph.keyframe(id).edges) {
    const int at = window.position.find(edge.other);
    if (!window.is_inner(at) || edge.weight <= best_weight) continue;
    best = at;
    best_weight = edge.weight;
  }
  return best;
}

/// Covisibility as it is now. A loop found by appearance has more matches than shared points: it keeps their
/// weight.
int present_weight(const Keyframe& from, const Keyframe& to) {
  const Edge& edge = *find_edge(from, to.id);
  const int shared = shared_points(from, to);
  return edge.marginalised ? std::max(shared, edge.weight) : std::max(shared, 1);
}

/// The present relative pose becomes the edge's constraint.
void marginalise(GraphWriter& writer, KeyframeId i, KeyframeId j) {
  const Keyframe& from = writer.graph().keyframe(i);
  const Keyframe& to = writer.graph().keyframe(j);
  link_marginalised(writer, i, j, present_weight(from, to), to.T_k_w * from.T_k_w.inverse());
}

void add_anchors(const GraphSnapshot& graph, std::size_t max_anchors, IdMap& met, DoubleWindow& window) {
  met.clear();
  std::size_t added = 0;
  for (std::size_t n = 0; n < window.inner && added < max_anchors; ++n) {
    for (const Observation& observation : *graph.keyframe(window.nodes[n].id).observations) {
      const KeyframeId anchor = graph.point(observation.point).anchor;
      if (met.contains(anchor) || window.contains(anchor)) continue;
      met.set(anchor, 0);
      if (graph.keyframe(anchor).culled()) continue;
      const int parent = strongest_inner_neighbour(graph, window, anchor);
      if (parent < 0) continue;
      window.position.set(anchor, static_cast<int>(window.nodes.size()));
      window.nodes.push_back({anchor, parent});
      if (++added == max_anchors) return;
    }
  }
}

/// Puts the nodes that stay next to each other, in their order. A node only stays if its parent does.
void remove_nodes(const std::vector<char>& stays, DoubleWindow& window) {
  std::vector<int> moved_to(window.nodes.size(), -1);
  std::size_t kept = 0;
  for (std::size_t n = 0; n < window.nodes.size(); ++n) {
    if (!stays[n]) continue;
    moved_to[n] = static_cast<int>(kept);
    TreeNode node = window.nodes[n];
    if (node.parent >= 0) node.parent = moved_to[static_cast<std::size_t>(node.parent)];
    window.nodes[kept++] = node;
  }
  window.nodes.resize(kept);
}

/// Back to the size the window had when `met` nodes had been found by breadth-first search: those met last go
/// first, unless they are anchors or others hang on them; after them the anchors that joined last.
void make_room(const GraphSnapshot& graph, std::size_t met, DoubleWindow& window) {
  const std::size_t count = window.nodes.size();
  std::vector<char> needed(count, 0), stays(count, 1);
  for (std::size_t n = 0; n < window.inner; ++n) {
    for (const Observation& observation : *graph.keyframe(window.nodes[n].id).observations) {
      const int anchor = window.position.find(graph.point(observation.point).anchor);
      if (anchor >= 0) needed[static_cast<std::size_t>(anchor)] = 1;
    }
  }
  std::size_t surplus = count - met;
  for (std::size_t n = met; n-- > window.inner && surplus > 0;) {
    if (needed[n]) {
      needed[static_cast<std::size_t>(window.nodes[n].parent)] = 1;
    } else {
      stays[n] = 0;
      --surplus;
    }
  }
  for (; surplus > 0; --surplus) stays[count - surplus] = 0;  // no node hangs on one that joined
  remove_nodes(stays, window);
}

}  // namespace

void DoubleWindow::number_nodes() {
  position.clear();
  for (std::size_t n = 0; n < nodes.size(); ++n) position.set(nodes[n].id, static_cast<int>(n));
}

DoubleWindow inner_window_of(std::vector<TreeNode> tree) {
  DoubleWindow window;
  window.nodes = std::move(tree);
  window.inner = window.nodes.size();
  window.number_nodes();
  return window;
}

void select_double_window(const GraphSnapshot& graph, const MapperOptions& options, SelectionScratch& scratch,
                          DoubleWindow& window) {
  const auto inner = static_cast<std::size_t>(options.inner_window);
  const std::size_t count = inner + static_cast<std::size_t>(options.outer_window);
  weighted_breadth_first(graph, graph.reference(), count, scratch.visited, window.nodes);
  window.inner = std::min(inner, window.nodes.size());
  window.number_nodes();
  const std::size_t met = window.nodes.size();
  add_anchors(graph, static_cast<std::size_t>(options.max_anchors), scratch.met_anchors, window);
  if (window.nodes.size() == met) return;
  make_room(graph, met, window);
  window.number_nodes();
}

int marginalise_left_edges(GraphWriter& writer, const DoubleWindow& before, const DoubleWindow& now,
                           const std::function<void(KeyframeId, KeyframeId)>& leaves) {
  struct Left {
    KeyframeId from, to;
  };
  std::vector<Left> left;
  const GraphSnapshot& graph = writer.graph();
  for (std::size_t n = 0; n < before.inner; ++n) {
    const KeyframeId i = before.nodes[n].id;
    if (graph.keyframe(i).culled()) continue;
    for (const Edge& edge : *graph.keyframe(i).edges) {
      const KeyframeId j = edge.other;
      const bool was_inner = before.is_inner(j);
      if (was_inner && j < i) continue;  // met from the other end
      const bool stays_inner = now.is_inner(i) && now.is_inner(j);
      const bool stays_tied = now.contains(i) && now.contains(j) && (now.is_inner(i) || now.is_inner(j));
      if (was_inner ? !stays_inner : (!edge.marginalised && !stays_tied)) left.push_back({i, j});
    }
  }
  for (const auto& [i, j] : left) {
    if (leaves) leaves(i, j);
    marginalise(writer, i, j);
  }
  return static_cast<int>(left.size());
}

int marginalise_all_edges(GraphWriter& writer) {
  int count = 0;
  const GraphSnapshot& graph = writer.graph();
  for (std::uint32_t k = 0; k < graph.keyframe_count(); ++k) {
    const KeyframeId i{k};
    const std::shared_ptr<const EdgeList> edges = graph.keyframe(i).edges;
    for (const Edge& edge : *edges) {
      if (edge.marginalised || edge.other < i) continue;  // each edge once
      marginalise(writer, i, edge.other);
      ++count;
    }
  }
  return count;
}

void marginalise_edges_of(GraphWriter& writer, const DoubleWindow& window) {
  for (const TreeNode& node : window.nodes) {
    const std::shared_ptr<const EdgeList> edges = writer.graph().keyframe(node.id).edges;
    for (const Edge& edge : *edges) {
      if (edge.other > node.id && window.contains(edge.other)) marginalise(writer, node.id, edge.other);
    }
  }
}

int enter_window(GraphWriter& writer, const IdMap& consistent, const DoubleWindow& window) {
  const GraphSnapshot& graph = writer.graph();
  const auto& nodes = window.nodes;
  std::vector<bool> reset(nodes.size(), false);
  std::vector<SE3> T_child_parent(nodes.size());
  int count = 0;
  // All relative poses are read before the first absolute one changes: unmarginalised edges are made of them.
  for (std::size_t n = 1; n < nodes.size(); ++n) {
    const auto parent = static_cast<std::size_t>(nodes[n].parent);
    reset[n] = reset[parent] || !consistent.contains(nodes[n].id);
    if (!reset[n]) continue;
    const Edge* edge = find_edge(graph.keyframe(nodes[parent].id), nodes[n].id);
    T_child_parent[n] = relative_pose(graph, nodes[parent].id, *edge);
    ++count;
  }
  for (std::size_t n = 1; n < nodes.size(); ++n) {  // eq. 6.3
    if (!reset[n]) continue;
    const KeyframeId parent = nodes[static_cast<std::size_t>(nodes[n].parent)].id;
    writer.set_pose(nodes[n].id, T_child_parent[n] * graph.keyframe(parent).T_k_w);
  }
  return count;
}

}  // namespace twofold
