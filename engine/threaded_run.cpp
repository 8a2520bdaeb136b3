#include "engine/threaded_run.hpp"

#include <bit>

#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

// One request is under way at most; its buffer may be in the loop closer's hands when the next is made.
constexpr std::size_t kRequests = 2;
// A worker that failed does not wake the reader: it looks this often.
constexpr auto kFailureCheck = std::chrono::milliseconds(50);

std::size_t ring_size(std::size_t wanted) {
  return std::bit_ceil(wanted);
}

}  // namespace

ThreadedRun::ThreadedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock)
    : options_(options),
      trace_(options.trace ? std::make_unique<Trace>() : nullptr),
      tracking_(rig, options, trace_.get()),
      mapping_(rig, options, trace_.get()),
      loop_closing_(rig, options, trace_.get()),
      logs_(options.logs, mapping_.replacement_log()),
      slots_(options.frame_slots),
      // In the rings, in the two threads' hands, and the tracker's spare one.
      proposals_pool_(2 * ring_size(options.proposal_slots) + 4,
                      [this](KeyframeProposal& proposal) { tracking_.prepare(proposal); }),
      frames_(ring_size(options.frame_slots)),
      done_(ring_size(options.frame_slots)),
      mapper_inbox_(ring_size(proposals_pool_.capacity()), ring_size(options.proposal_slots)),
      keyframes_(ring_size(options.proposal_slots)),
      request_pool_(kRequests, [&](RelocalisationRequest& request) { allocate_images(rig, request.images); }),
      requests_(kRequests),
      answers_(kRequests),
      snapshots_(options.checkpoint.period > 0 ? 3 : 2, mapping_.publish()),
      places_(1, loop_closing_.places()),
      checkpoints_(rig, options.checkpoint),
      pacer_(options.pacing, clock),
      effort_controller_(options.effort, options.pacing.late) {}

void ThreadedRun::run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                      const ProgressSink& progress) {
  const FrameSink show = [&](const FrameRecord&, const PoseCorrection&) {
    if (progress) progress(progress_);
  };
  start();
  FeedStatus status = FeedStatus::kEnd;
  Frame frame;
  // Relaxed: the flag carries no other data.
  while (!interrupted.load(std::memory_order_relaxed) && wait_for_room(show) &&
         (status = feed(frame)) == FeedStatus::kFrame) {
    push(std::move(frame));
  }
  result_.interrupted = interrupted.load(std::memory_order_relaxed);
  if (status == FeedStatus::kError) result_.error = "the input ended with an error";
  stop();
  collect(show);
}

void ThreadedRun::start() {
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
  if (checkpoints_.enabled()) {
    checkpointer_.emplace(WorkerOptions{.name = "checkpoints", .time_slice = kPatientSlice},
                          [this](const std::stop_token& stop) { checkpoint_thread(stop); });
  }
}

bool ThreadedRun::has_buffer() {
  if (!free_slot_) free_slot_ = slots_.try_acquire();
  return static_cast<bool>(free_slot_);
}

bool ThreadedRun::has_room() {
  return has_buffer() && !must_hold_back();
}

void ThreadedRun::push(Frame frame) {
  TWOFOLD_CHECK(free_slot_, "there is a buffer for the frame");
  free_slot_->frame = std::move(frame);
  TWOFOLD_CHECK(frames_.try_push(std::move(free_slot_)), "the ring holds every slot of the pool");
  tracker_parking_.wake();
}

void ThreadedRun::wait(std::chrono::steady_clock::time_point deadline) {
  const bool full = !has_room();
  const auto ready = [&] { return done_.size_approx() > 0 || (full && has_room()); };
  (void)reader_parking_.wait_until({}, deadline, ready);
}

bool ThreadedRun::wait_for_room(const FrameSink& sink) {
  for (;;) {
    collect(sink);
    if (failed()) return false;
    if (has_room()) return true;
    wait(std::chrono::steady_clock::now() + kFailureCheck);
  }
}

void ThreadedRun::stop() {
  stopped_ = true;
  frames_ended_.store(true, std::memory_order_release);
  tracker_parking_.wake();
  join_threads();
}

/// As fast as possible means as fast as the map and the disk can follow: without a clock to keep, frames wait
/// for them.
bool ThreadedRun::must_hold_back() const {
  return !options_.pacing.keeps_pace() && (mapper_inbox_.proposals_approx() > 1 || logs_.behind());
}

bool ThreadedRun::failed() const {
  const auto ended = [](const std::optional<Worker>& worker) { return worker && worker->finished(); };
  if (stopped_) return false;
  return loop_closer_failed_.load(std::memory_order_relaxed) || ended(tracker_) || ended(mapper_) ||
         ended(loop_closer_) || ended(checkpointer_);
}

void ThreadedRun::collect(const FrameSink& sink) {
  SlotHandle slot;
  while (done_.try_pop(slot)) {
    const FrameRecord& record = slot->record;
    progress_.count(record);
    progress_.map_version = map_version_.load(std::memory_order_relaxed);
    progress_.queued = keyframes_waiting();
    progress_.frames_waiting = frames_waiting();
    progress_.places_waiting = places_waiting();
    logs_.add(record, slot->correction);
    logs_.schedule().tracker.append(slot->step);
    slot->frame = {};  // images are freed here, not on the tracker's thread
    if (sink) sink(record, slot->correction);
    slot.reset();
  }
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

/// The loop closer ends after the mapper: what it sent last is taken here, all threads being gone.
void ThreadedRun::map_late_loops() {
  (void)mapper_inbox_.take();
  if (mapper_inbox_.loops().empty()) return;
  const std::uint64_t version = mapping_.step({}, mapper_inbox_.loops());
  (void)mapping_.publish();
  logs_.schedule().mapper.append({version, 0, static_cast<std::uint32_t>(mapper_inbox_.loops().size())});
}

RunResult ThreadedRun::finish() {
  collect({});
  map_late_loops();
  logs_.close(mapping_.replacement_log(), result_);
  collect_results(tracking_, mapping_, loop_closing_, result_);
  result_.checkpoints = checkpoints_.report();
  result_.trace = std::move(trace_);
  result_.keyframes_not_described = not_described_.load(std::memory_order_relaxed);
  return std::move(result_);
}

}  // namespace twofold
