#pragma once

#include <optional>

#include "engine/result.hpp"
#include "twofold/estimate.hpp"

namespace twofold {

/// Turns what the tracker reports into the public face's estimates and events. On the tracker's thread: no
/// lock, no allocation.
class PoseReporter {
 public:
  /// What a frame changed beside the camera's pose; at most a correction and then a new place.
  struct Events {
    std::optional<MapEvent> correction;
    std::optional<MapEvent> placing;  ///< relocalisation or new part
  };

  /// To be called for every report, in their order.
  [[nodiscard]] PoseEstimate next(const PoseReport& report, Events& events);

 private:
  void find_events(const PoseReport& report, const PoseEstimate& now, Events& events) const;
  /// Where the last tracked frame is in the map of this one; none if that is unknown, or in another part.
  [[nodiscard]] std::optional<SE3> last_T_c_w(const PoseReport& report) const;

  FrameRecord last_;  // the last frame that was tracked; of state kLost before the first
  bool was_lost_ = false;
};

}  // namespace twofold
