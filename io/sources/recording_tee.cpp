#include "io/sources/recording_tee.hpp"

#include <fmt/format.h>

namespace twofold {

RecordingTee::RecordingTee(std::unique_ptr<FrameSource> source, const std::filesystem::path& folder,
                           const RecorderOptions& options)
    : source_(std::move(source)),
      folder_(folder),
      recorder_(folder, source_->rig().kind, calibration_of(source_->rig()), options) {
  rig_ = source_->rig();
  R_rectified_raw_ = source_->R_rectified_raw();
  ground_truth_ = source_->ground_truth();
}

bool RecordingTee::read(Frame& frame) {
  if (!next_or_throw(*source_, frame)) return false;
  frame.index = next_index_++;
  // A camera does not wait for the disk; what it refused is counted there.
  (void)recorder_.offer(frame, !source_->is_live());
  return true;
}

SourceReport RecordingTee::report() const {
  SourceReport report = source_->report();
  const Recorder::Counts counts = recorder_.counts();
  report.summary.push_back(
      fmt::format("recorded    {} frames in {}", counts.written + counts.queued, folder_.string()));
  return report;
}

std::string RecordingTee::finish() {
  const std::string reason = recorder_.finish();
  const std::uint64_t missing = recorder_.counts().refused;
  if (missing == 0) return reason;
  return fmt::format("{}: {} frames are missing in the recording, from which the run cannot be repeated: {}",
                     folder_.string(), missing,
                     reason.empty() ? "writing was slower than the camera" : reason);
}

}  // namespace twofold
