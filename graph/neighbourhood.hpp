#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "graph/snapshot.hpp"

namespace twofold {

/// Scratch of searches over the graph: which keyframes or points were already met. Grows to the largest id
/// seen and is cleared in O(1) by counting rounds.
class VisitedSet {
 public:
  /// Starts a new round for ids below `size`.
  void reset(std::size_t size);
  /// True the first time an id is inserted in this round; ids beyond the size of the round are a bug.
  bool insert(std::uint32_t id);
  [[nodiscard]] bool contains(std::uint32_t id) const { return id < marks_.size() && marks_[id] == round_; }
  void reserve(std::size_t size) { marks_.reserve(size); }

 private:
  std::vector<std::uint32_t> marks_;
  std::uint32_t round_ = 0;
};

/// Keyframe met by a search, and the edge it was met along: the searches' spanning tree  (6.2.3).
struct TreeNode {
  KeyframeId id = kNoKeyframe;
  int parent = -1;  ///< index in the result; -1 for the root
};

/// Weighted breadth-first search from `root` over the covisibility graph: level by level, within a level the
/// edges of highest weight first. Stops after `max_count` keyframes, root included  (6.2.3). Ties go to the
/// lower id, so that the result depends on the graph alone. `result` is refilled; `visited` then holds its
/// members.
void weighted_breadth_first(const GraphSnapshot& graph, KeyframeId root, std::size_t max_count,
                            VisitedSet& visited, std::vector<TreeNode>& result);

/// N1: the keyframe and all it has an edge to, strongest first  (eq. 6.5). Appends at most `max_count` ids.
void direct_neighbours(const GraphSnapshot& graph, KeyframeId id, std::size_t max_count,
                       std::vector<KeyframeId>& result);

/// Points seen from the given keyframes that are alive, each once, in order of first sight. Appends to
/// `result`.
void visible_points(const GraphSnapshot& graph, std::span<const KeyframeId> keyframes, VisitedSet& visited,
                    std::vector<PointId>& result);

}  // namespace twofold
