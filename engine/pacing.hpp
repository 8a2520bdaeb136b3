#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>

#include "camera/usual_interval.hpp"
#include "engine/clock.hpp"
#include "engine/parking.hpp"

namespace twofold {

enum class LatePolicy : std::uint8_t {
  kQueue,  ///< every frame is processed; lateness adds up until the engine catches up
  kDrop,   ///< frames whose successor is due already may be skipped (EffortController says when)
  kNewest  ///< a frame whose successor is due already is skipped
};

struct PacingOptions {
  double speed = 1.0;                    ///< recorded seconds a second; 0 = as fast as possible; finite, >= 0
  LatePolicy late = LatePolicy::kQueue;  ///< without meaning without a pace
  /// Frames come from a camera, when they are taken, and their time stamps are of the steady clock: the pace
  /// is the camera's, `speed` has no meaning.
  bool live = false;

  [[nodiscard]] bool keeps_pace() const { return live || speed > 0; }

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Reads and sleeps on the steady clock; tests put their own in its place.
class PacingClock {
 public:
  virtual ~PacingClock() = default;
  [[nodiscard]] virtual std::int64_t now_ns() { return steady_now_ns(); }
  /// Returns at t_ns, or earlier when a stop is requested.
  virtual void sleep_until(std::int64_t t_ns, const std::stop_token& stop);

 private:
  Parking parking_;
};

/// What became of one frame's turn.
struct Arrival {
  std::int64_t exposed_ns = 0;  ///< when the frame was exposed on the steady clock; latency counts from here
  std::int64_t late_ns = 0;     ///< how long after that its turn came, >= 0
  std::int64_t period_ns = 0;   ///< between exposures, usually; 0: there is no pace, or it is not known yet
  bool overtaken = false;       ///< its successor is exposed already
};

/// Says when each frame was exposed, on the steady clock, and waits for that where it is still to come.
///
/// A camera's frame was exposed at its time stamp: there is nothing to wait for. A recorded frame is given
/// out at the pace at which it was taken: the first is exposed when it is asked for, every other one (t -
/// t_first) / speed later. Exposures follow this schedule, never the end of the work on the frame before: a
/// frame that waited for its predecessors is late by the whole wait, so that one slow frame shows in the
/// latency of all it delayed (no coordinated omission). Without a pace a frame is exposed when it is asked
/// for.
class Pacer {
 public:
  /// clock: nullptr for the steady clock; otherwise outlives the pacer.
  explicit Pacer(const PacingOptions& options, PacingClock* clock = nullptr);

  /// Waits for the exposure of the frame with time stamp t_ns, unless end_waits was called.
  /// @param successor_t_ns  asked after the wait: time stamp of the frame behind it, nullopt when none is
  /// there
  template <class SuccessorStamp>
  [[nodiscard]] Arrival wait_for(std::int64_t t_ns, SuccessorStamp&& successor_t_ns) {
    Arrival arrival = wait_for(t_ns);
    const std::optional<std::int64_t> next_t_ns = successor_t_ns();
    arrival.overtaken =
        options_.keeps_pace() && next_t_ns && exposed_ns(*next_t_ns) <= arrival.exposed_ns + arrival.late_ns;
    return arrival;
  }

  /// From now on nobody waits: a frame that is still to be exposed is exposed when it is asked for. Any
  /// thread; ends a wait that lasts.
  void end_waits() { waits_ended_.request_stop(); }

  /// Time on the clock that frames are paced by [ns].
  [[nodiscard]] std::int64_t now_ns() { return clock_->now_ns(); }

 private:
  [[nodiscard]] Arrival wait_for(std::int64_t t_ns);
  [[nodiscard]] std::int64_t exposed_ns(std::int64_t t_ns) const;

  PacingOptions options_;
  PacingClock steady_;
  PacingClock* clock_;
  std::stop_source waits_ended_;
  UsualInterval interval_;  // by time stamps
  bool started_ = false;
  std::int64_t first_t_ns_ = 0;
  std::int64_t start_ns_ = 0;
};

}  // namespace twofold
