#include "tracking/keyframes/keyframe_decision.hpp"

#include <algorithm>

namespace twofold {

bool keyframe_due(const TrackResult& result, const KeyframeView& last, int occupied_regions,
                  const KeyframeBacklog& backlog, const KeyframeDecisionOptions& options,
                  const EffortBounds& bounds) {
  if (!backlog.room) return false;
  const double share = result.reference_in_view * result.matches / std::max(1, result.searched);
  if (share < options.urgent_share) return true;
  if (backlog.pending >= options.max_pending) return false;
  const double way = result.T_c_ref.translation().norm(), parallax = options.parallax * last.median_depth;
  const bool first_needs_second = backlog.map_is_young && way > options.young_map_share * parallax;
  if (bounds.urgent_keyframes_only) return first_needs_second;
  const bool emptied = occupied_regions < (1 - options.emptied_share) * last.occupied_regions;
  return way > parallax || share < options.tracked_share || emptied || first_needs_second;
}

bool keyframe_due_by_motion(const SE3& T_c_ref, const KeyframeView& last, const KeyframeBacklog& backlog,
                            const KeyframeDecisionOptions& options) {
  if (!backlog.room || backlog.pending >= options.max_pending) return false;
  return T_c_ref.translation().norm() > options.parallax * last.median_depth ||
         T_c_ref.so3().log().norm() > options.turn;
}

}  // namespace twofold
