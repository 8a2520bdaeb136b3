#pragma once

#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>

#include "engine/clock.hpp"
#include "engine/parking.hpp"

namespace twofold {

enum class LatePolicy : std::uint8_t {
  kQueue,  ///< every frame is processed; lateness adds up until the engine catches up
  kDrop,   ///< frames whose successor is due already may be skipped (EffortController says when)
};

struct PacingOptions {
  double speed = 1.0;                    ///< recorded seconds a second; 0 = as fast as possible; finite, >= 0
  LatePolicy late = LatePolicy::kQueue;  ///< without meaning at speed 0

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
  std::int64_t scheduled_ns = 0;  ///< when the frame was due on the steady clock; latency counts from here
  std::int64_t late_ns = 0;       ///< how long after that its turn came, >= 0
  std::int64_t period_ns = 0;     ///< from its due time to its successor's; 0: there is no pace
  bool overtaken = false;         ///< its successor is due already, and the policy allows to skip it
};

/// Gives out recorded frames at the pace at which they were taken.
///
/// The first frame is due when it is asked for, every other one (t - t_first) / speed later. Frames are due
/// by this schedule, never by when the last one was finished: a frame that waited for its predecessors is
/// late by the whole wait, so that one slow frame shows in the latency of all it delayed (no coordinated
/// omission). At speed 0 a frame is due when it is asked for.
class Pacer {
 public:
  /// clock: nullptr for the steady clock; otherwise outlives the pacer.
  explicit Pacer(const PacingOptions& options, PacingClock* clock = nullptr);

  /// Waits for the turn of the frame taken at t_ns. next_t_ns: time stamp of its successor, nullopt for the
  /// last frame, which is never overtaken. Nor is the first. A stop request ends the wait early.
  [[nodiscard]] Arrival wait_for(std::int64_t t_ns, std::optional<std::int64_t> next_t_ns,
                                 const std::stop_token& stop);

  /// Time on the clock that frames are paced by [ns].
  [[nodiscard]] std::int64_t now_ns() { return clock_->now_ns(); }

 private:
  [[nodiscard]] std::int64_t due_ns(std::int64_t t_ns) const;

  PacingOptions options_;
  PacingClock steady_;
  PacingClock* clock_;
  bool started_ = false;
  std::int64_t first_t_ns_ = 0;
  std::int64_t start_ns_ = 0;
  std::int64_t period_ns_ = 0;  // of the frame before: the last one has no successor
};

}  // namespace twofold
