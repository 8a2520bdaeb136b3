#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/logs/log_writer.hpp"
#include "engine/logs/replacement_log.hpp"
#include "engine/logs/schedule_log.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"

namespace twofold {

/// What a run leaves behind, taken down as it arises: records of frames, corrections, the replacements of
/// culled keyframes, the schedule. With a folder (RunLogOptions) all of it goes to disk, where
/// trajectory_causal.txt and schedule.log are whole at any time but for the last 0.1 s; without one it stays
/// in memory. Poses and records that a full disk does not take wait for room within the bound of LogFile; the
/// others are missing, and the file goes on behind them. The schedule ends there: each step builds on the one
/// before it. On disk, not in reserve: what the operating system has not written yet is lost with its power.
///
/// Roles: note_input and add by the thread that pushes frames and takes them back; each stream of the
/// schedule and the replacement log by one thread each; close when these are joined.
class RunLogs {
 public:
  /// Throws std::runtime_error when a file cannot be made.
  RunLogs(const RunLogOptions& options, ReplacementLog& replacements);

  /// A frame that is done with, and the correction that was seen first by it, if it has a reason.
  void add(const FrameRecord& record, const PoseCorrection& correction);
  [[nodiscard]] ScheduleStreams& schedule() { return schedule_; }
  /// Before a frame is pushed: of the first, the schedule gets the fingerprint.
  void note_input(const Rig& rig, const Frame& frame) {
    if (!schedule_.input) schedule_.note_input(fingerprint_of(rig, frame));
  }

  /// The disk is slower than the run; any thread.
  [[nodiscard]] bool behind() const { return writer_ && writer_->behind(); }
  /// Returns when it is not. For runs without a pace.
  void wait_for_room() {
    if (writer_) writer_->wait_for_room();
  }

  /// What was lost so far: a sentence a file; any thread.
  [[nodiscard]] std::vector<std::string> errors() const {
    return writer_ ? writer_->errors() : std::vector<std::string>{};
  }

  /// Ends the files and moves the records into the result, with what was lost.
  void close(ReplacementLog& replacements, RunResult& result);

 private:
  void open_files(ReplacementLog& replacements);
  /// A pose for the causal trajectory. After poses that were lost a comment says how many, and of when.
  void add_causal(const FrameRecord& record);
  /// One section a thread: the bytes do not depend on the threads' turns.
  void merge_schedule_file();

  const RunLogOptions options_;
  FrameCounts counts_;
  RecordSequence<FrameRecord> frames_;
  RecordSequence<PoseCorrection> corrections_;
  ScheduleStreams schedule_;
  // What lines of the causal trajectory were lost since the last one that was taken.
  struct Gap {
    std::int64_t poses = 0, first_t_ns = 0, last_t_ns = 0;
  };
  KeyframeId part_ = kNoKeyframe;  // of the line before in the causal trajectory
  Gap gap_;
  std::shared_ptr<LogFile> causal_, schedule_file_;
  std::optional<LogWriter> writer_;
};

}  // namespace twofold
