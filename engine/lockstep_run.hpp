#pragma once

#include <deque>

#include "engine/engine.hpp"
#include "engine/stages.hpp"

namespace twofold {

/// All steps on the calling thread, in an order given from outside: the deterministic run maps each keyframe
/// at once, the replay follows a schedule.
class LockstepRun {
 public:
  LockstepRun(const Rig& rig, const EngineOptions& options);

  void run(const FrameFeed& feed, const std::atomic<bool>& interrupted, const ProgressSink& progress);
  void replay(const FrameFeed& feed, const Schedule& schedule, const std::atomic<bool>& interrupted,
              const ProgressSink& progress);
  /// Final relaxation; moves the result out.
  [[nodiscard]] RunResult finish();

 private:
  void track(const Frame& frame, bool may_propose, bool refuse);
  void map(std::size_t proposals);
  void drop(const Frame& frame);
  void report(const ProgressSink& progress);
  void fail(const std::string& why) { result_.error = why; }

  std::unique_ptr<Trace> trace_;
  ProposalPool pool_;
  TrackingStage tracking_;
  MappingStage mapping_;
  std::deque<ProposalHandle> queue_;
  std::vector<ProposalHandle> consumed_;
  GraphSnapshot snapshot_;  // what the tracker sees; replaced between its steps only
  RunResult result_;
  Progress progress_;
};

}  // namespace twofold
