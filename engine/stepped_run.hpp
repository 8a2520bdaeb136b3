#pragma once

#include <array>
#include <atomic>
#include <mutex>
#include <stop_token>

#include "engine/checkpoint_writer.hpp"
#include "engine/effort_controller.hpp"
#include "engine/logs/run_logs.hpp"
#include "engine/mapper_inbox.hpp"
#include "engine/pacing.hpp"
#include "engine/parking.hpp"
#include "engine/pipeline.hpp"
#include "engine/runners.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/spsc_ring.hpp"

namespace twofold {

/// Tracker, mapper and loop closer joined by rings and snapshots, each taking a step when it is told to.
///
///   push --frames--> tracker --proposals--> mapper --keyframes--> loop closer
///     ^-----done-------+   ^---- snapshots ----+---- snapshots ------^
///                          ^                   ^------- loops -------+
///                          +--- requests: where am I? ---> answers --+
///
/// A step takes what waits for it, and never waits for another one. If the mapper is behind, there is no free
/// buffer for a keyframe, and tracking goes on with the points it has. If the tracker itself is late, it goes
/// down the effort levels. Each step is taken by one thread at a time, the three of them at once if the
/// caller likes: ThreadedRun has a thread for each.
class SteppedRun : public Pipeline {
 public:
  /// clock: nullptr for the steady clock; otherwise read and slept on by the tracker's step alone.
  SteppedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock = nullptr);

  [[nodiscard]] bool has_buffer() override;
  [[nodiscard]] bool has_room() override;
  void push(Frame frame) override;
  void collect(const FrameSink& sink) override;
  void wait(std::chrono::steady_clock::time_point deadline) override;
  [[nodiscard]] bool failed() const override;
  [[nodiscard]] bool step(PipelineStep step) override;
  [[nodiscard]] std::vector<std::string> log_errors() const override { return logs_.errors(); }
  [[nodiscard]] std::string checkpoint_error() const override { return checkpoints_.newest_error(); }
  [[nodiscard]] const Progress& progress() const override { return progress_; }
  [[nodiscard]] WaitingCounts waiting() const override {
    return {channels_.frames.size_approx(), channels_.mapper_inbox.proposals_approx(),
            channels_.keyframes.size_approx()};
  }
  void end_pace() override { pacer_.end_waits(); }
  /// Takes all steps that are left, on this thread.
  void stop() override;
  [[nodiscard]] RunResult finish() override;

 protected:
  // One step each; false when there was nothing to do. Each by one thread at a time.

  /// No lock, no allocation, no input or output.
  [[nodiscard]] bool step_tracker();
  [[nodiscard]] bool step_mapper();
  [[nodiscard]] bool step_loop_closer();

  /// Of the loop closer, instead of step_loop_closer: every request is answered with nothing.
  [[nodiscard]] bool answer_nothing();

  // On the thread of that step: whether something waits for it.
  [[nodiscard]] bool tracker_has_work() { return channels_.frames.has_value(); }
  /// Of the loop closer, who has not sent it yet.
  [[nodiscard]] bool tracker_awaits_answer() {
    return tracking_.awaits_answer() && !channels_.answers.has_value();
  }
  [[nodiscard]] bool mapper_has_work() { return !channels_.mapper_inbox.empty(); }
  [[nodiscard]] bool loop_closer_has_work() {
    return channels_.requests.has_value() || channels_.keyframes.has_value();
  }
  [[nodiscard]] bool awaits_answer() { return answering_ || channels_.requests.has_value(); }

  /// Reads the newest versions where they are, for as long as it takes: publishing goes on meanwhile, and the
  /// versions read are destroyed by their writers when newer ones are asked for. By one thread.
  void save_checkpoint();
  [[nodiscard]] const CheckpointWriter& checkpoints() const { return checkpoints_; }

  const EngineOptions options_;
  RunResult result_;
  // Where the threads that take steps, and the one that pushes, sleep while there is nothing to do.
  Parking reader_parking_, tracker_parking_, mapper_parking_, loop_parking_;

 private:
  static constexpr std::size_t kTrackerReader = 0;  // mailboxes of Channels::snapshots
  static constexpr std::size_t kLoopReader = 1;
  static constexpr std::size_t kCheckpointReader = 2;

  struct FrameSlot {
    Frame frame;
    FrameRecord record;
    TrackerStep step;           ///< for the schedule
    PoseCorrection correction;  ///< seen first by this frame, if there is a reason
  };
  using SlotPool = FramePool<FrameSlot>;
  using SlotHandle = SlotPool::Handle;

  /// What goes from step to step, and the pools its buffers come from and go back to.
  struct Channels {
    /// @param tracking               prepares the buffers of keyframes
    /// @param mapping, loop_closing  have the first versions of map and places
    Channels(const Rig& rig, const EngineOptions& options, const TrackerRunner& tracking,
             MapperRunner& mapping, const LoopCloserRunner& loop_closing);

    SlotPool slots;
    ProposalPool proposals;
    SpscRing<SlotHandle> frames;         // push -> tracker
    SpscRing<SlotHandle> done;           // tracker -> collect; as long as the pool, so that it cannot be full
    MapperInbox mapper_inbox;            // tracker, loop closer -> mapper
    SpscRing<ProposalHandle> keyframes;  // mapper -> loop closer
    RequestPool request_buffers;
    SpscRing<RequestHandle> requests;        // tracker -> loop closer; one at most is under way
    SpscRing<RelocalisationAnswer> answers;  // loop closer -> tracker
    SnapshotPublisher<GraphSnapshot> snapshots;
    SnapshotPublisher<KeyframeDatabase> places;  // loop closer -> checkpoints
  };

  [[nodiscard]] bool take(PipelineStep step);
  void begin_step(PipelineStep step) const;

  // Of the thread that pushes.
  [[nodiscard]] bool must_hold_back() const;
  void map_late_loops();

  // Of the tracker's step.
  void track(FrameSlot& slot, const Arrival& arrival, const GraphSnapshot& graph);
  void drop(FrameSlot& slot);
  [[nodiscard]] std::optional<std::int64_t> successor_t_ns();
  void send_proposal();
  void prepare_spare();
  void take_answers(TrackerStep& step);
  void ask_where_we_are();

  // Of the loop closer's.
  /// False when there was no request.
  [[nodiscard]] bool answer_request();
  void send_answer(RelocalisationAnswer answer, const LoopStep& step);
  void send_loops(std::span<LoopMessage> messages, LoopStep& step);
  void publish_places();

  const Rig rig_;
  std::unique_ptr<Trace> trace_;
  Progress progress_;

  TrackerRunner tracking_;
  MapperRunner mapping_;
  LoopCloserRunner loop_closing_;
  RunLogs logs_;

  Channels channels_;
  CheckpointWriter checkpoints_;
  Pacer pacer_;
  EffortController effort_controller_;

  SlotHandle free_slot_;    // pushing thread's: where the next frame goes
  ProposalHandle spare_;    // tracker's: the buffer the next keyframe goes to
  bool answering_ = false;  // loop closer's: it has taken a request

  // Held by whoever takes that step when the caller's threads do, so that what one thread did in a step is
  // seen by the one that takes the next; nobody waits for one but stop.
  std::array<std::mutex, 3> turns_;
  std::array<std::string, 3> failure_;  // likewise: empty, or whose step threw what
  bool steps_ended_ = false;            // guarded by all of them
  // Relaxed: it publishes nothing; seeing it a step later is as good.
  std::atomic<bool> step_failed_{false};
  // Counters for the progress line; relaxed, because they publish nothing.
  std::atomic<std::uint64_t> map_version_{0}, not_described_{0};
};

}  // namespace twofold
