#include "tracking/keyframes/keyframe_decision.hpp"

#include <algorithm>

namespace twofold {

bool keyframe_due(const TrackResult& result, const KeyframeView& last, int occupied_regions,
                  const KeyframeBacklog& backlog, const TrackerOptions& options, const EffortBounds& bounds) {
  if (!backlog.room) return false;
  const double share = result.reference_in_view * result.matches / std::max(1, result.searched);
  if (share < options.urgent_share) return true;
  if (backlog.pending >= options.max_pending) return false;
  const double parallax = result.T_c_ref.translation().norm() / std::max(last.median_depth, kNearestDepth);
  const bool first_needs_second =
      backlog.map_is_young && parallax > options.young_map_share * options.keyframe_parallax;
  if (bounds.urgent_keyframes_only) return first_needs_second;
  const bool emptied = occupied_regions < (1 - options.keyframe_empty) * last.occupied_regions;
  return parallax > options.keyframe_parallax || share < options.keyframe_share || emptied ||
         first_needs_second;
}

bool keyframe_due_by_motion(const SE3& T_c_ref, const KeyframeView& last, const KeyframeBacklog& backlog,
                            const TrackerOptions& options) {
  if (!backlog.room || backlog.pending >= options.max_pending) return false;
  const double parallax = T_c_ref.translation().norm() / std::max(last.median_depth, kNearestDepth);
  return parallax > options.keyframe_parallax || T_c_ref.so3().log().norm() > options.keyframe_turn;
}

}  // namespace twofold
