#pragma once

#include <optional>

#include "tracking/common/effort.hpp"
#include "tracking/common/track_result.hpp"
#include "tracking/keyframes/options.hpp"

namespace twofold {

/// What later frames are judged by: how the scene looked from the newest keyframe.
struct KeyframeView {
  double median_depth = 0;   ///< [m]
  int occupied_regions = 0;  ///< regions of the image in which a point was tracked
  /// Of one camera: how much of the reference was found at best since, found_share of the keyframe itself and
  /// reference_share of the present frame included. None where KeyframeDecisionOptions::tracked_share alone
  /// counts.
  std::optional<double> most_tracked = std::nullopt;
};

/// What of the map a frame tracks.
struct TrackedView {
  int occupied_regions = 0;       ///< of the image, in which a point is tracked
  bool revisits = false;          ///< a place seen long ago (KeyframeDecisionOptions::revisited_share)
  bool young_mistrusted = false;  ///< something moves, and new points may be on it (ElderVote)
};

/// What stands in the way of a keyframe, or makes one welcome.
struct KeyframeBacklog {
  bool room = false;          ///< for one more proposal
  int pending = 0;            ///< proposals not yet in the map
  bool map_is_young = false;  ///< it has one keyframe only, whose points wait to be confirmed
};

/// Share of the points looked for that were found.
[[nodiscard]] double found_share(const TrackResult& result);
/// Of the reference's points, those out of view included.
[[nodiscard]] double reference_share(const TrackResult& result);

/// Whether the frame should become a keyframe: the camera has moved on, or too little is left of what it saw
/// (thesis 6.2.5).
/// @param last  of the newest keyframe
/// @param seen  by this frame
[[nodiscard]] bool keyframe_due(const TrackResult& result, const KeyframeView& last, const TrackedView& seen,
                                const KeyframeBacklog& backlog, const KeyframeDecisionOptions& options,
                                const EffortBounds& bounds);

/// The same for a frame that was placed by its depth image (TrackResult::by_depth): the camera has moved on
/// or turned, and there may be corners again.
[[nodiscard]] bool keyframe_due_by_motion(const SE3& T_c_ref, const KeyframeView& last,
                                          const KeyframeBacklog& backlog,
                                          const KeyframeDecisionOptions& options);

}  // namespace twofold
