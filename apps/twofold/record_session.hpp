#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "io/sources/frame_source.hpp"
#include "io/sources/recorder.hpp"

namespace twofold {

/// What became of every frame of a recording.
struct RecordOutcome {
  Recorder::Counts counts;
  SourceReport report;
  std::string problem;  ///< of writing or of the source; empty if none

  /// Nothing is missing but what the camera itself lost.
  [[nodiscard]] bool all_written() const { return problem.empty() && counts.refused == 0; }
};

/// Hands a source's frames to the recorder until it ends, writing fails, `frames` (0: any number) have come
/// or `stop` is set, and waits until what is queued is written. A camera does not wait for the disk: frames
/// the queue has no room for are refused and counted; a recording waits.
///
/// @param tick  called after every frame
[[nodiscard]] RecordOutcome record_from(FrameSource& source, Recorder& recorder, std::int64_t frames,
                                        const std::atomic<bool>& stop, const std::function<void()>& tick);

/// Lines for people: what was written, what was lost by whom, the camera's faults.
[[nodiscard]] std::string describe(const RecordOutcome& outcome);

}  // namespace twofold
