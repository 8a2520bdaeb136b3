#pragma once

#include <vector>

#include "graph/graph_writer.hpp"
#include "graph/keyframe_proposal.hpp"

namespace twofold {

/// The map without its back-end: proposals are inserted as they come, nothing is optimised or culled. What is
/// measured on top of it is the tracker's own drift.
class PlainMap {
 public:
  /// Keyframes that share at least `min_shared` points get an edge.
  explicit PlainMap(int min_shared = 15) : min_shared_(min_shared) {}

  void insert(const KeyframeProposal& proposal);
  /// Moves everything from world w to world v.
  void transform(const SE3& T_v_w);
  [[nodiscard]] GraphSnapshot publish() { return writer_.publish(); }

 private:
  void link(const Keyframe& keyframe);

  GraphWriter writer_;
  int min_shared_;
  std::vector<int> shared_;
};

}  // namespace twofold
