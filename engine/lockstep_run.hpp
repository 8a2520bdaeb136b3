#pragma once

#include <deque>
#include <limits>

#include "engine/checkpoint_writer.hpp"
#include "engine/engine.hpp"
#include "engine/logs/run_logs.hpp"
#include "engine/mapper_inbox.hpp"
#include "engine/runners.hpp"

namespace twofold {

/// All steps on the calling thread, in an order given from outside: the deterministic run maps each keyframe
/// at once, the replay follows a schedule.
class LockstepRun {
 public:
  LockstepRun(const Rig& rig, const EngineOptions& options);

  /// The deterministic run: each frame is mapped before the next one.
  void run(const FrameFeed& feed, const std::atomic<bool>& interrupted, const ProgressSink& progress);
  /// One frame of it. The record is valid until the next call.
  const FrameRecord& step(const Frame& frame);
  void replay(const FrameFeed& feed, const Schedule& schedule, const std::atomic<bool>& interrupted,
              const ProgressSink& progress);
  /// What the logs have lost so far: a sentence a file.
  [[nodiscard]] std::vector<std::string> log_errors() const { return logs_.errors(); }
  /// Final pose graph optimisation; moves the result out.
  [[nodiscard]] RunResult finish();

 private:
  /// `step` says what the frame meets: effort level, answers, whether a keyframe may be made.
  void track(const Frame& frame, const TrackerStep& step);
  /// `refused`: with nothing, as a loop closer does that has failed.
  void answer_request(const GraphSnapshot& graph, bool refused = false);
  void map(std::size_t proposals, std::size_t loop_messages);
  /// One step of the loop closer for a keyframe; the last `refused` of its messages found the ring full.
  void close_loops(const KeyframeProposal& keyframe, const GraphSnapshot& graph, std::size_t refused);
  /// Takes all steps of the loop closer whose inputs are there. It does not matter when within the replay a
  /// step is taken: what it sends waits until the schedule says that it arrived.
  void replay_loop_steps(const Schedule& schedule);
  /// Were all messages of this round sent?
  [[nodiscard]] bool can_map(const MapperStep& round) const;
  void drop(const Frame& frame, const TrackerStep& step);
  /// By the time of the recording: the same in every run.
  void checkpoint_if_due(std::int64_t t_ns);
  /// The newest record.
  void count();
  void fail(const std::string& why) { result_.error = why; }

  const bool localise_only_;
  std::unique_ptr<Trace> trace_;
  ProposalPool pool_;
  TrackerRunner tracking_;
  MapperRunner mapping_;
  LoopCloserRunner loop_closing_;
  RunLogs logs_;
  FrameRecord record_;  // of the newest frame
  MapperInbox mapper_inbox_;
  std::deque<ProposalHandle> mapped_;  // keyframes the loop closer has not seen
  std::size_t next_loop_step_ = 0;     // of a replay
  std::deque<GraphSnapshot> history_;  // of a replay: versions that loop closer steps may still need
  std::optional<RelocalisationRequest> request_;
  std::optional<RelocalisationAnswer> answer_;
  CheckpointWriter checkpoints_;
  std::int64_t checkpoint_due_ns_ = std::numeric_limits<std::int64_t>::min();
  GraphSnapshot snapshot_;  // what the tracker sees; replaced between its steps only
  RunResult result_;
  Progress progress_;
};

}  // namespace twofold
