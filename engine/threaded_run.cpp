#include "engine/threaded_run.hpp"

namespace twofold {

ThreadedRun::ThreadedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock)
    : SteppedRun(rig, options, clock) {
  loop_closer_.emplace(
      WorkerOptions{.name = "loop closer", .cpu = options_.loop_closer_cpu, .time_slice = kPatientSlice},
      [this](const std::stop_token& stop) { loop_closer_thread(stop); });
  mapper_.emplace(WorkerOptions{.name = "mapper", .cpu = options_.mapper_cpu, .time_slice = kPatientSlice},
                  [this](const std::stop_token& stop) { mapper_thread(stop); });
  tracker_.emplace(WorkerOptions{.name = "tracker",
                                 .cpu = options_.tracker_cpu,
                                 .fifo_priority = options_.fifo_priority,
                                 .time_slice = kPromptSlice},
                   [this](const std::stop_token& stop) { tracker_thread(stop); });
  if (checkpoints().enabled()) {
    checkpointer_.emplace(WorkerOptions{.name = "checkpoints", .time_slice = kPatientSlice},
                          [this](const std::stop_token& stop) { checkpoint_thread(stop); });
  }
}

void ThreadedRun::stop() {
  stopped_ = true;
  frames_ended_.store(true, std::memory_order_release);
  tracker_parking_.wake();
  join_threads();
}

bool ThreadedRun::failed() const {
  const auto ended = [](const std::optional<Worker>& worker) { return worker && worker->finished(); };
  if (stopped_) return false;
  return loop_closer_failed_.load(std::memory_order_relaxed) || ended(tracker_) || ended(mapper_) ||
         ended(loop_closer_) || ended(checkpointer_);
}

void ThreadedRun::join_threads() {
  // In the order of the chain: each ends when the one before it has and its ring is empty.
  const auto join = [this](Worker& worker, std::atomic<bool>& next_ended, Parking* next) {
    if (const auto outcome = worker.join(); !outcome && result_.error.empty())
      result_.error = outcome.error();
    for (const std::string& note : worker.notes()) result_.notes.push_back(note);
    next_ended.store(true, std::memory_order_release);
    if (next != nullptr) next->wake();
  };
  std::atomic<bool> nobody{false};
  join(*tracker_, proposals_ended_, &mapper_parking_);
  join(*mapper_, keyframes_ended_, &loop_parking_);
  join(*loop_closer_, nobody, nullptr);
  if (checkpointer_) {
    checkpointer_->request_stop();
    join(*checkpointer_, nobody, nullptr);
  }
}

void ThreadedRun::tracker_thread(const std::stop_token& stop) {
  const std::stop_callback on_stop(stop, [this] { end_pace(); });
  // As fast as possible means as fast as a lost camera is told where it is: without a clock to keep, the next
  // frame waits for the answer, which would else say where the camera was many frames ago.
  const auto ready = [this] {
    if (tracker_has_work()) return options_.pacing.keeps_pace() || !tracker_awaits_answer();
    return frames_ended_.load(std::memory_order_acquire) && !tracker_has_work();
  };
  while (tracker_parking_.wait(stop, ready) && step_tracker()) {
  }
}

void ThreadedRun::mapper_thread(const std::stop_token& stop) {
  const auto ready = [this] { return mapper_has_work() || proposals_ended_.load(std::memory_order_acquire); };
  while (mapper_parking_.wait(stop, ready) && step_mapper()) {
  }
}

/// A loop closer that fails still answers the camera that asks where it is: nothing found.
void ThreadedRun::loop_closer_thread(const std::stop_token& stop) {
  try {
    const auto ready = [this] {
      return loop_closer_has_work() || keyframes_ended_.load(std::memory_order_acquire);
    };
    while (loop_parking_.wait(stop, ready) && step_loop_closer()) {
    }
  } catch (...) {
    loop_closer_failed_.store(true, std::memory_order_relaxed);
    reader_parking_.wake();
    const auto ready = [this] { return awaits_answer() || keyframes_ended_.load(std::memory_order_acquire); };
    while (loop_parking_.wait(stop, ready) && answer_nothing()) {
    }
    throw;
  }
}

void ThreadedRun::checkpoint_thread(const std::stop_token& stop) {
  yield_to_other_threads();
  while (!stop.stop_requested()) {
    const auto due = std::chrono::steady_clock::now() + std::chrono::nanoseconds(checkpoints().period_ns());
    (void)checkpoint_parking_.wait_until(stop, due, [] { return false; });
    if (stop.stop_requested()) return;  // the caller saves the final map
    if (options_.before_step) options_.before_step("checkpoints");
    save_checkpoint();
  }
}

}  // namespace twofold
