#include "tracking/keyframes/keyframe_decision.hpp"

#include <algorithm>

namespace twofold {
namespace {

/// Of the reference's points, below which a keyframe is due.
double least_share(const TrackResult& result, const KeyframeView& last, const TrackedView& seen,
                   const KeyframeDecisionOptions& options) {
  const bool one_camera = last.most_tracked.has_value();  // a keyframe gives it no points at once
  const bool few = result.inliers < options.few_points && !seen.young_mistrusted && !one_camera;
  return few ? std::max(options.few_tracked_share, options.tracked_share) : options.tracked_share;
}

/// Whether the camera has hardly moved, tracks enough, and still finds about as much as it did.
bool may_wait(const TrackResult& result, const KeyframeView& last, const TrackedView& seen,
              const KeyframeDecisionOptions& options) {
  if (!last.most_tracked || result.inliers < options.waiting_inliers) return false;
  const double most_parallax =
      (seen.revisits ? options.revisiting_way : options.waiting_way) * options.parallax;
  return result.T_c_ref.translation().norm() <= most_parallax * last.median_depth &&
         reference_share(result) >= (1 - options.lost_share) * *last.most_tracked;
}

}  // namespace

double found_share(const TrackResult& result) {
  return static_cast<double>(result.matches) / std::max(1, result.searched);
}

double reference_share(const TrackResult& result) {
  return result.reference_in_view * result.matches / std::max(1, result.searched);
}

bool keyframe_due(const TrackResult& result, const KeyframeView& last, const TrackedView& seen,
                  const KeyframeBacklog& backlog, const KeyframeDecisionOptions& options,
                  const EffortBounds& bounds) {
  if (!backlog.room) return false;
  const double share = reference_share(result);
  if (share < options.urgent_share) return true;
  if (backlog.pending >= options.max_pending) return false;
  const double way = result.T_c_ref.translation().norm(), parallax = options.parallax * last.median_depth;
  const bool first_needs_second = backlog.map_is_young && way > options.young_map_share * parallax;
  if (bounds.urgent_keyframes_only) return first_needs_second;
  const bool emptied = seen.occupied_regions < (1 - options.emptied_share) * last.occupied_regions;
  const bool lost =
      share < least_share(result, last, seen, options) && !may_wait(result, last, seen, options);
  return way > parallax || lost || emptied || first_needs_second;
}

bool keyframe_due_by_motion(const SE3& T_c_ref, const KeyframeView& last, const KeyframeBacklog& backlog,
                            const KeyframeDecisionOptions& options) {
  if (!backlog.room || backlog.pending >= options.max_pending) return false;
  return T_c_ref.translation().norm() > options.parallax * last.median_depth ||
         T_c_ref.so3().log().norm() > options.turn;
}

}  // namespace twofold
