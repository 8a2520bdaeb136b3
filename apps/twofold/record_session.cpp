#include "apps/twofold/record_session.hpp"

#include <fmt/format.h>

namespace twofold {

RecordOutcome record_from(FrameSource& source, Recorder& recorder, std::int64_t frames,
                          const std::atomic<bool>& stop, const std::function<void()>& tick) {
  FrameStatus status = FrameStatus::kEnd;
  for (std::int64_t n = 0; frames == 0 || n < frames; ++n) {
    // Relaxed: the flag carries no other data.
    if (stop.load(std::memory_order_relaxed)) break;
    Frame frame;  // a new one each time: the queue keeps the images
    if ((status = source.next(frame)) != FrameStatus::kFrame) break;
    if (!recorder.offer(frame, !source.is_live()) && recorder.failed()) break;
    tick();
  }
  RecordOutcome outcome;
  outcome.problem = recorder.finish();
  if (outcome.problem.empty() && status == FrameStatus::kError) outcome.problem = source.error();
  outcome.counts = recorder.counts();
  outcome.report = source.report();
  return outcome;
}

std::string describe(const RecordOutcome& outcome) {
  std::string text =
      fmt::format("{} frames, {:.1f} MB; lost: {} by the camera, {} because writing was too slow or failed\n",
                  outcome.counts.written, static_cast<double>(outcome.counts.bytes) * 1e-6,
                  outcome.report.lost, outcome.counts.refused);
  for (const std::string& line : outcome.report.summary) text += line + "\n";
  for (const std::string& line : outcome.report.faults) text += "  " + line + "\n";
  return text;
}

}  // namespace twofold
