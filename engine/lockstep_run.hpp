#pragma once

#include <deque>
#include <limits>
#include <optional>

#include "engine/checkpoint_writer.hpp"
#include "engine/logs/run_logs.hpp"
#include "engine/mapper_inbox.hpp"
#include "engine/pipeline.hpp"
#include "engine/runners.hpp"

namespace twofold {

/// All steps within push, on the calling thread: the deterministic run maps each keyframe before the next
/// frame, the replay follows a schedule.
class LockstepRun final : public Pipeline {
 public:
  /// schedule: of the run to be repeated; nothing: the deterministic run
  LockstepRun(const Rig& rig, const EngineOptions& options, std::optional<Schedule> schedule = {});

  [[nodiscard]] bool has_buffer() override { return true; }
  [[nodiscard]] bool has_room() override { return true; }
  /// Of a replay: frames that the schedule leaves out, as one that found no buffer then, count as dropped.
  /// What a step throws comes out, and the run has failed.
  void push(Frame frame) override;
  void collect(const FrameSink& sink) override;
  void wait(std::chrono::steady_clock::time_point) override {}
  [[nodiscard]] bool failed() const override { return !result_.error.empty(); }
  [[nodiscard]] bool ended() const override { return failed() || (schedule_ && frames_due() == 0); }
  [[nodiscard]] std::size_t frames_due() const override {
    return schedule_ ? schedule_->tracker.size() - next_frame_ : 0;
  }
  [[nodiscard]] std::vector<std::string> log_errors() const override { return logs_.errors(); }
  [[nodiscard]] std::string checkpoint_error() const override { return checkpoints_.newest_error(); }
  [[nodiscard]] const Progress& progress() const override { return progress_; }
  void stop() override;
  [[nodiscard]] RunResult finish() override;

 private:
  void take(const Frame& frame);
  void run_deterministically(const Frame& frame);
  void replay(const Frame& frame);
  /// Rounds of the mapper until the tracker sees this version. False when the schedule lacks one, or has one
  /// that needs what was not sent.
  [[nodiscard]] bool replay_rounds_until(std::uint64_t version);
  void replay_round(const MapperStep& round);
  /// The schedule asks for what did not happen: that of a killed run ends here, any other belongs to other
  /// frames.
  void end_replay(const char* why);
  /// `step` says what the frame meets: effort level, answers, whether a keyframe may be made.
  void track(const Frame& frame, const TrackerStep& step);
  /// `refused`: with nothing, as a loop closer does that has failed.
  void answer_request(const GraphSnapshot& graph, bool refused = false);
  void map(std::size_t proposals, std::size_t loop_messages);
  /// Whether the loop closer gets to know this keyframe: one that found its ring full in the run of the
  /// schedule does not wait for it here either. To be asked in the order of ids.
  [[nodiscard]] bool is_described(KeyframeId id);
  /// One step of the loop closer for a keyframe; the last `refused` of its messages found the ring full.
  void close_loops(const KeyframeProposal& keyframe, const GraphSnapshot& graph, std::size_t refused);
  /// Takes all steps of the loop closer whose inputs are there. It does not matter when within the replay a
  /// step is taken: what it sends waits until the schedule says that it arrived.
  void replay_loop_steps();
  /// Were all messages of this round sent?
  [[nodiscard]] bool can_map(const MapperStep& round) const;
  void drop(const Frame& frame, const TrackerStep& step);
  /// By the time of the recording: the same in every run.
  void checkpoint_if_due(std::int64_t t_ns);
  /// The newest record.
  void count();
  void fail(const std::string& why) { result_.error = why; }

  /// Of a replay, with its first frame: fails when the schedule is of another input.
  void expect_input_of_schedule();

  const Rig rig_;
  std::unique_ptr<Trace> trace_;
  TrackerRunner tracking_;
  ProposalPool pool_;
  MapperRunner mapping_;
  LoopCloserRunner loop_closing_;
  RunLogs logs_;
  FrameRecord record_;         // of the newest frame
  PoseCorrection correction_;  // likewise
  bool collected_ = true;      // likewise
  MapperInbox mapper_inbox_;
  std::deque<ProposalHandle> mapped_;  // keyframes that the loop closer is going to see
  // Of a replay: the schedule, what of it comes next, and versions that loop closer steps may still need.
  std::optional<Schedule> schedule_;
  std::size_t next_frame_ = 0, next_round_ = 0, next_loop_step_ = 0;
  std::size_t next_described_ = 0;  // of the loop closer's steps, for the keyframe mapped next
  std::deque<GraphSnapshot> history_;
  std::optional<RelocalisationRequest> request_;
  std::optional<RelocalisationAnswer> answer_;
  CheckpointWriter checkpoints_;
  std::int64_t checkpoint_due_ns_ = std::numeric_limits<std::int64_t>::min();
  GraphSnapshot snapshot_;  // what the tracker sees; replaced between its steps only
  RunResult result_;
  Progress progress_;
};

}  // namespace twofold
