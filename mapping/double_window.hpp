#pragma once

#include <span>
#include <vector>

#include "graph/neighbourhood.hpp"
#include "mapping/options.hpp"

namespace twofold {

/// Members of the double window around the reference keyframe, and their start poses  (thesis 6.2.3).
///
/// Keeps the members of the round before: who was not among them is placed anew along relative edges.
class DoubleWindow {
 public:
  /// Weighted breadth-first search from the graph's reference: the first M1 keyframes are W1, the next M2 are
  /// W2. Then eq. 6.3: poses that were not in the old window, and all their children in the spanning tree,
  /// are set along the tree's relative edges, so that a loop that does not close breaks at the rim.
  void select(const GraphSnapshot& graph, const MapperOptions& options);
  /// Adds a keyframe to W2: an anchor of points seen from W1 that has an edge to `parent` in W1  (6.2.4).
  /// Returns its position.
  int add_anchor(const GraphSnapshot& graph, KeyframeId id, int parent);

  [[nodiscard]] std::span<const TreeNode> members() const { return members_; }
  [[nodiscard]] std::size_t inner_count() const { return inner_count_; }
  /// Start pose T_k_w of a member, by position.
  [[nodiscard]] const SE3& start_pose(std::size_t position) const { return poses_[position]; }
  /// Position of a keyframe among the members, -1 for others.
  [[nodiscard]] int position(KeyframeId id) const;
  [[nodiscard]] bool in_inner(KeyframeId id) const {
    const int p = position(id);
    return p >= 0 && static_cast<std::size_t>(p) < inner_count_;
  }

 private:
  void place(const GraphSnapshot& graph, std::size_t position);

  std::vector<TreeNode> members_;
  std::vector<SE3> poses_;
  std::vector<std::uint8_t> placed_anew_;
  std::size_t inner_count_ = 0;
  std::vector<int> positions_;        // by keyframe id; -1
  std::vector<KeyframeId> previous_;  // members of the round before, ascending
  VisitedSet visited_;
};

}  // namespace twofold
