#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <vector>

#include "graph/id_map.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// Scratch of searches over the graph: which keyframes or points were already met. Memory and time follow
/// what is met, not the ids.
class VisitedSet {
 public:
  /// Forgets what was inserted, and takes ids below `size`.
  void reset(std::size_t size);
  /// True the first time an id is inserted since the last reset; ids beyond its size are a bug.
  bool insert(std::uint32_t id);
  [[nodiscard]] bool contains(std::uint32_t id) const { return met_.find(id) >= 0; }
  /// Makes room for `count` ids.
  void reserve(std::size_t count) { met_.reserve(count); }

 private:
  IdMap met_;
  std::size_t size_ = 0;
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

/// Calls visit(tree) for each connected component of the keyframes that were not culled, with what
/// weighted_breadth_first finds from its root: first the reference keyframe's, rooted there, then the others,
/// by their oldest keyframe, which is the root. Poses, points and what edges hold may change meanwhile, which
/// keyframes are connected may not.
void for_each_component(const GraphSnapshot& graph,
                        const std::function<void(const std::vector<TreeNode>& tree)>& visit);

/// N1: the keyframe and all it has an edge to, strongest first  (eq. 6.5). Appends at most `max_count` ids.
void direct_neighbours(const GraphSnapshot& graph, KeyframeId id, std::size_t max_count,
                       std::vector<KeyframeId>& result);

/// Points seen from the given keyframes that were not culled, each once, in order of first sight. Appends to
/// `result`.
void visible_points(const GraphSnapshot& graph, std::span<const KeyframeId> keyframes, VisitedSet& visited,
                    std::vector<PointId>& result);

}  // namespace twofold
