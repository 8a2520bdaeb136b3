#include "graph/keyframe_proposal.hpp"

namespace twofold {

void KeyframeProposal::clear() {
  id = reference = kNoKeyframe;
  frame_index = t_ns = 0;
  snapshot_version = 0;
  T_k_ref = SE3();
  pose_information.setZero();
  median_depth = 0;
  observations.clear();
  points.clear();
}

}  // namespace twofold
