#pragma once

#include <string>

namespace twofold {

/// When a frame becomes a keyframe (tracking/keyframes/keyframe_decision.hpp).
struct KeyframeDecisionOptions {
  double parallax = 0.09;       ///< |t| since the reference keyframe over the newest one's median depth, > 0
  double tracked_share = 0.65;  ///< of the reference's points, in [0, 1]: with fewer still tracked a keyframe
                                ///< is due
  // Where points are hard to find again, another keyframe does not make them easier: with fewer than
  // tracked_share one camera waits with it ...
  int waiting_inliers = 80;     ///< while it still tracks so many points, >= 0,
  double lost_share = 0.05;     ///< until so much is gone of what the last keyframe found, or the best frame
                                ///< since, as a share of it, in [0, 1],
  double waiting_way = 0.2;     ///< or it has moved by this share of the parallax, in [0, 1] ...
  double revisiting_way = 0.5;  ///< ... where it sees a place again by this one, in [0, 1]. Along a street,
                                ///< where points last for a few keyframes, these hold its unit of length.
  int revisited_after = 30;     ///< keyframes after a point was begun it is one of a place seen again, >= 1
  double revisited_share = 0.25;  ///< of the points tracked, in (0, 1]: with so many of those it is one
  /// With fewer points tracked, >= 0; 0: never: a keyframe is due earlier where depth is measured, because
  /// the next turn may leave none of them, and before a keyframe nobody looks for others. Not while something
  /// passes by: it would get points sooner, too ...
  int few_points = 65;
  double few_tracked_share = 0.8;  ///< ... below this share, in [0, 1], if it is more than tracked_share
  /// A keyframe is due when fewer than 1 - emptied_share times as many image regions hold a tracked point as
  /// at the last keyframe. In [0, 1].
  double emptied_share = 0.5;
  double turn = 0.2;  ///< since the reference keyframe, where depth alone says how the camera moved [rad] > 0
  /// Share of the parallax, in [0, 1], at which a map's second keyframe is due: it confirms the points of the
  /// first, and until then there is no map.
  double young_map_share = 0.2;
  double urgent_share = 0.35;  ///< as tracked_share, in [0, tracked_share]; below it a keyframe is due
                               ///< whatever max_pending says
  int max_pending = 2;         ///< with so many proposals on their way to the map none is made, >= 1

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// When an older keyframe becomes the reference again (tracking/keyframes/reference_choice.hpp).
struct ReferenceChoiceOptions {
  int interval = 3;             ///< frames between looks for a better reference, >= 1
  double min_gain_share = 0.2;  ///< by which it must see more of what is found than the present one, >= 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

}  // namespace twofold
