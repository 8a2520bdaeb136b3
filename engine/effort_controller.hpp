#pragma once

#include <cstdint>
#include <string>

#include "engine/pacing.hpp"
#include "tracking/common/effort.hpp"

namespace twofold {

/// Lateness is the time from when a frame was due to when its pose was known, in frame periods at the pace of
/// the run: at 1 the next frame is due.
struct EffortOptions {
  double late = 1;     ///< a frame later than this: one level down
  double early = 0.6;  ///< earlier than this, `patience` frames in a row: one level up; 0 < early <= late
  int patience = 30;   ///< [frames] >= 1
  double drop_after = 1.5;  ///< waiting longer for its turn, a frame is dropped on any level; >= late

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// How much work the tracker leaves out, decided by its own lateness and by nothing else: down at once, one
/// effort level for each late frame, up again slowly, one level after `patience` early ones. Between `early`
/// and `late` the level stays, so that the time a level saves does not bring the level before it back.
///
/// The tracker thread's alone; no clock is read here, nothing is allocated. Runs without a pace (speed 0)
/// have no lateness and stay on the first level; deterministic runs never ask; replays take the levels from
/// the log.
class EffortController {
 public:
  EffortController(const EffortOptions& options, LatePolicy late);

  [[nodiscard]] EffortLevel effort() const { return effort_; }
  /// Whether the frame whose turn it is is to be dropped: its successor is there, and the policy wants only
  /// that, or allows to drop and either nothing else is left to leave out or the delay would grow beyond its
  /// bound.
  [[nodiscard]] bool must_drop(const Arrival& arrival) const;

  /// A frame's pose was known `latency_ns` after it was due.
  void tracked(std::int64_t latency_ns, std::int64_t period_ns);
  void dropped() { down(); }

 private:
  void down();

  EffortOptions options_;
  LatePolicy late_;
  EffortLevel effort_ = EffortLevel::kEverything;
  int early_frames_ = 0;  ///< in a row
};

}  // namespace twofold
