#pragma once

#include "engine/stepped_run.hpp"
#include "engine/worker.hpp"

namespace twofold {

/// The live engine: a thread for each of the three steps, asleep while there is nothing to do. A fourth one,
/// if checkpoints are wanted, saves what mapper and loop closer published: it only reads.
class ThreadedRun final : public SteppedRun {
 public:
  /// Starts the threads. clock: as of SteppedRun.
  ThreadedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock = nullptr);

  /// Also when a thread has ended early.
  [[nodiscard]] bool failed() const override;
  /// There is nothing to do for others.
  [[nodiscard]] bool step(PipelineStep) override { return false; }
  void stop() override;

 private:
  void tracker_thread(const std::stop_token& stop);
  void mapper_thread(const std::stop_token& stop);
  void loop_closer_thread(const std::stop_token& stop);
  void checkpoint_thread(const std::stop_token& stop);
  void join_threads();

  bool stopped_ = false;  // pushing thread's
  Parking checkpoint_parking_;
  // Each is raised by the thread before in the chain, with release, after its last push: who sees it
  // (acquire) and then finds the ring empty has seen everything.
  std::atomic<bool> frames_ended_{false}, proposals_ended_{false}, keyframes_ended_{false};
  // Raised by a loop closer that has failed and goes on answering; relaxed, because it publishes nothing.
  std::atomic<bool> loop_closer_failed_{false};

  std::optional<Worker> checkpointer_, loop_closer_, mapper_,
      tracker_;  // last: join before what they use is destroyed
};

}  // namespace twofold
