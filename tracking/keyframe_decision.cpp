#include "tracking/keyframe_decision.hpp"

#include <algorithm>

namespace twofold {

bool keyframe_due(const TrackResult& result, const KeyframeView& last, int occupied_regions,
                  const KeyframeBacklog& backlog, const TrackerOptions& options, const EffortBounds& bounds) {
  if (!backlog.room) return false;
  const double share = result.reference_in_view * result.matches / std::max(1, result.searched);
  if (share < options.urgent_share) return true;
  if (backlog.pending >= options.max_pending) return false;
  const double parallax = result.T_c_ref.translation().norm() / std::max(last.median_depth, kNearestDepth);
  // The second keyframe confirms the first one's points: until then there is no map.
  const bool first_needs_second = backlog.map_is_young && parallax > 0.2 * options.keyframe_parallax;
  if (bounds.urgent_keyframes_only) return first_needs_second;
  const bool emptied = occupied_regions < (1 - options.keyframe_empty) * last.occupied_regions;
  return parallax > options.keyframe_parallax || share < options.keyframe_share || emptied ||
         first_needs_second;
}

bool keyframe_due_by_motion(const SE3& T_c_ref, const KeyframeView& last, const KeyframeBacklog& backlog,
                            const TrackerOptions& options) {
  constexpr double kTurned = 0.2;  // [rad]
  if (!backlog.room || backlog.pending >= options.max_pending) return false;
  const double parallax = T_c_ref.translation().norm() / std::max(last.median_depth, kNearestDepth);
  return parallax > options.keyframe_parallax || T_c_ref.so3().log().norm() > kTurned;
}

}  // namespace twofold
