#pragma once

#include <optional>

#include "engine/options.hpp"
#include "engine/result.hpp"
#include "slam/map_movements.hpp"
#include "twofold/estimate.hpp"

namespace twofold {

/// Turns what the tracker reports into the public face's estimates and events: for class Slam, and for all
/// that the program shows and writes of a run. On the tracker's thread: no lock, no allocation.
class PoseReporter {
 public:
  /// What a frame changed beside the camera's pose; at most a correction and then a new place.
  struct Events {
    std::optional<MapEvent> correction;
    std::optional<MapEvent> placing;  ///< relocalisation or new part
  };

  /// Adds listeners to those of `options`, by which events know what moved in the map; this object must
  /// outlive the run. Without it they know of the camera alone.
  void listen(EngineOptions& options);

  /// To be called for every report, in their order: hands over the events, and then the estimate.
  template <class EventSink, class PoseSink>
  void tell(const PoseReport& report, EventSink&& event, PoseSink&& pose) {
    Events events;
    const PoseEstimate estimate = next(report, events);
    if (events.correction) event(*events.correction);
    if (events.placing) event(*events.placing);
    pose(estimate);
  }
  /// Likewise.
  [[nodiscard]] PoseEstimate next(const PoseReport& report, Events& events);

 private:
  void find_events(const PoseReport& report, const PoseEstimate& now, Events& events);
  void tell_joined(const PoseReport& report, const MapMovement& movement, const PoseEstimate& now,
                   Events& events) const;
  /// Where the last tracked frame is in the map of this one; none if that is unknown, or in another part.
  [[nodiscard]] std::optional<SE3> last_T_c_w(const PoseReport& report) const;

  MapMovements movements_;
  // The last frame that was tracked, with the pose and part it was last said to have; of state kLost before
  // the first.
  FrameRecord last_;
  bool was_lost_ = true;  // or not placed yet
  SE3 T_odom_c_;          // of the last tracked frame
};

}  // namespace twofold
