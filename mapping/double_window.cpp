#include "mapping/double_window.hpp"

#include <algorithm>

namespace twofold {

int DoubleWindow::position(KeyframeId id) const {
  return index(id) < positions_.size() ? positions_[index(id)] : -1;
}

void DoubleWindow::select(const GraphSnapshot& graph, const MapperOptions& options) {
  previous_.clear();
  for (const TreeNode& node : members_) {
    previous_.push_back(node.id);
    positions_[index(node.id)] = -1;
  }
  std::sort(previous_.begin(), previous_.end());

  const std::size_t count = options.global_outer_window
                                ? graph.keyframe_count()
                                : static_cast<std::size_t>(options.inner_window + options.outer_window);
  weighted_breadth_first(graph, graph.reference(), count, visited_, members_);
  inner_count_ = std::min(members_.size(), static_cast<std::size_t>(options.inner_window));
  if (positions_.size() < graph.keyframe_count()) positions_.resize(graph.keyframe_count(), -1);
  poses_.resize(members_.size());
  placed_anew_.resize(members_.size());
  for (std::size_t n = 0; n < members_.size(); ++n) {
    positions_[index(members_[n].id)] = static_cast<int>(n);
    place(graph, n);
  }
}

void DoubleWindow::place(const GraphSnapshot& graph, std::size_t n) {
  const TreeNode& node = members_[n];
  const Keyframe& keyframe = graph.keyframe(node.id);
  const bool is_new = !std::binary_search(previous_.begin(), previous_.end(), node.id);
  const bool parent_moved = node.parent >= 0 && placed_anew_[static_cast<std::size_t>(node.parent)] != 0;
  placed_anew_[n] = node.parent >= 0 && (is_new || parent_moved) ? 1 : 0;
  if (placed_anew_[n] == 0) {
    poses_[n] = keyframe.T_k_w;
    return;
  }
  const auto parent = static_cast<std::size_t>(node.parent);
  const KeyframeId parent_id = members_[parent].id;
  poses_[n] =
      relative_pose(graph, parent_id, *find_edge(graph.keyframe(parent_id), node.id)) * poses_[parent];
}

int DoubleWindow::add_anchor(const GraphSnapshot& graph, KeyframeId id, int parent) {
  const std::size_t n = members_.size();
  members_.push_back({id, parent});
  poses_.emplace_back();
  placed_anew_.push_back(0);
  positions_[index(id)] = static_cast<int>(n);
  place(graph, n);
  return static_cast<int>(n);
}

}  // namespace twofold
