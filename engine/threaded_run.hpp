#pragma once

#include <atomic>
#include <chrono>

#include "engine/checkpoint_writer.hpp"
#include "engine/engine.hpp"
#include "engine/logs/run_logs.hpp"
#include "engine/mapper_inbox.hpp"
#include "engine/pacing.hpp"
#include "engine/parking.hpp"
#include "engine/runners.hpp"
#include "engine/snapshot_mailbox.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/worker.hpp"

namespace twofold {

/// Takes a frame that is done with, and the correction of the map that was seen first by it, if any.
using FrameSink = std::function<void(const FrameRecord&, const PoseCorrection&)>;

/// The live engine: three threads that share snapshots and rings, fed by the calling thread.
///
///   reader --frames--> tracker --proposals--> mapper --keyframes--> loop closer
///     ^------done-------+   ^---- snapshots ----+---- snapshots ------^
///                           ^                   ^------- loops -------+
///                           +--- requests: where am I? ---> answers --+
///
/// A fourth thread, if checkpoints are wanted, saves what mapper and loop closer published: it only reads.
///
/// The tracker never waits for another thread but for its next frame. If the mapper is behind, there is no
/// free buffer for a keyframe, and tracking goes on with the points it has. If the tracker itself is late, it
/// goes down the effort levels.
class ThreadedRun {
 public:
  /// clock: nullptr for the steady clock; otherwise read and slept on by the tracker thread alone.
  ThreadedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock = nullptr);

  /// Frames from a feed, until it ends, `interrupted` is true or a thread fails: all of the calls below.
  void run(const FrameFeed& feed, const std::atomic<bool>& interrupted, const ProgressSink& progress);

  // The same a frame at a time. One thread makes these calls: start, then has_room, push, collect and wait in
  // any order, then stop and finish. None but wait, stop and finish blocks.

  void start();
  /// Whether a frame can be pushed now. Room is made by collect.
  [[nodiscard]] bool has_buffer();  ///< for a frame
  /// Likewise, and map and disk follow if there is no clock to keep.
  [[nodiscard]] bool has_room();
  /// Hands a frame to the tracker; there must be room. Frame::index and time stamps grow.
  void push(Frame frame);
  /// Takes back the frames that are done with, in the order they were pushed. The argument of `sink`, which
  /// may be empty, is valid during the call only.
  void collect(const FrameSink& sink);
  /// Sleeps until a frame can be collected, or there is room where there was none; not beyond `deadline`.
  void wait(std::chrono::steady_clock::time_point deadline);
  /// A thread has ended early: time to stop; RunResult::error says why.
  [[nodiscard]] bool failed() const;
  /// What the logs have lost so far: a sentence a file.
  [[nodiscard]] std::vector<std::string> log_errors() const { return logs_.errors(); }
  /// Counts of what was collected.
  [[nodiscard]] const Progress& progress() const { return progress_; }
  /// What waits for tracker, mapper and loop closer. Any thread, wait-free: no more than a look at the rings.
  [[nodiscard]] std::size_t frames_waiting() const { return frames_.size_approx(); }
  [[nodiscard]] std::size_t keyframes_waiting() const { return mapper_inbox_.proposals_approx(); }
  [[nodiscard]] std::size_t places_waiting() const { return keyframes_.size_approx(); }
  /// No more frames: returns when all that were pushed have been tracked and mapped. They can still be
  /// collected.
  void stop();
  /// Collects what was not, and optimises the whole pose graph; moves the result out.
  [[nodiscard]] RunResult finish();

 private:
  static constexpr std::size_t kTrackerReader = 0;  // mailboxes of snapshots_
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

  // On the calling thread.
  /// False when a thread failed.
  [[nodiscard]] bool wait_for_room(const FrameSink& sink);
  [[nodiscard]] bool must_hold_back() const;
  void join_threads();

  // One each on its own thread.
  void tracker_thread(const std::stop_token& stop);
  void mapper_thread(const std::stop_token& stop);
  void loop_closer_thread(const std::stop_token& stop);
  void checkpoint_thread(const std::stop_token& stop);

  void track(FrameSlot& slot, const Arrival& arrival, const GraphSnapshot& graph);
  void drop(FrameSlot& slot);
  [[nodiscard]] std::optional<std::int64_t> successor_t_ns();
  void send_proposal();
  void prepare_spare();
  void take_answers(TrackerStep& step);
  void ask_where_we_are();
  /// False when there was no request.
  bool answer_request();
  void close_loops(const std::stop_token& stop);
  void send_answer(RelocalisationAnswer answer, const LoopStep& step);
  /// To every request, until the tracker has ended.
  void answer_nothing(const std::stop_token& stop);
  /// Before each step of a thread.
  void begin_step(const char* thread) const {
    if (options_.before_step) options_.before_step(thread);
  }
  void send_loops(std::span<LoopMessage> messages, LoopStep& step);
  void map_late_loops();
  void publish_places();

  EngineOptions options_;
  std::unique_ptr<Trace> trace_;
  RunResult result_;
  Progress progress_;

  TrackerRunner tracking_;
  MapperRunner mapping_;
  LoopCloserRunner loop_closing_;
  RunLogs logs_;

  SlotPool slots_;
  ProposalPool proposals_pool_;
  SpscRing<SlotHandle> frames_;         // reader -> tracker
  SpscRing<SlotHandle> done_;           // tracker -> reader; as long as the pool, so that it cannot be full
  MapperInbox mapper_inbox_;            // tracker, loop closer -> mapper
  SpscRing<ProposalHandle> keyframes_;  // mapper -> loop closer
  RequestPool request_pool_;
  SpscRing<RequestHandle> requests_;        // tracker -> loop closer; one at most is under way
  SpscRing<RelocalisationAnswer> answers_;  // loop closer -> tracker
  SnapshotPublisher<GraphSnapshot> snapshots_;
  SnapshotPublisher<KeyframeDatabase> places_;  // loop closer -> checkpoints
  CheckpointWriter checkpoints_;
  Pacer pacer_;
  EffortController effort_controller_;

  SlotHandle free_slot_;    // feeding thread's: where the next frame goes
  ProposalHandle spare_;    // tracker's: the buffer the next keyframe goes to
  bool answering_ = false;  // loop closer's: it has taken a request
  bool stopped_ = false;    // feeding thread's

  Parking reader_parking_, tracker_parking_, mapper_parking_, loop_parking_, checkpoint_parking_;
  // Each is raised by the thread before in the chain, with release, after its last push: who sees it
  // (acquire) and then finds the ring empty has seen everything.
  std::atomic<bool> frames_ended_{false}, proposals_ended_{false}, keyframes_ended_{false};
  // Raised by a loop closer that has failed and goes on answering; relaxed, because it publishes nothing.
  std::atomic<bool> loop_closer_failed_{false};
  // Counters for the progress line; relaxed, because they publish nothing.
  std::atomic<std::uint64_t> map_version_{0}, not_described_{0};

  std::optional<Worker> checkpointer_, loop_closer_, mapper_,
      tracker_;  // last: join before what they use is destroyed
};

}  // namespace twofold
