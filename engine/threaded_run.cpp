#include "engine/threaded_run.hpp"

#include <bit>

namespace twofold {
namespace {

constexpr std::size_t kTrackerReader = 0;
constexpr std::size_t kLoopReader = 1;
constexpr std::size_t kCheckpointReader = 2;
// One request is under way at most; its buffer may be in the loop closer's hands when the next is made.
constexpr std::size_t kRequests = 2;
// A worker that failed does not wake the reader: it looks this often.
constexpr auto kFailureCheck = std::chrono::milliseconds(50);

std::size_t ring_size(std::size_t wanted) {
  return std::bit_ceil(wanted);
}

}  // namespace

ThreadedRun::ThreadedRun(const Rig& rig, const EngineOptions& options)
    : options_(options),
      trace_(options.trace ? std::make_unique<Trace>() : nullptr),
      tracking_(rig, options, trace_.get()),
      mapping_(rig, options, trace_.get()),
      loop_closing_(rig, options, trace_.get()),
      slots_(options.frame_slots),
      // In the rings, in the two threads' hands, and the tracker's spare one.
      proposals_pool_(2 * ring_size(options.proposal_slots) + 4),
      frames_(ring_size(options.frame_slots)),
      done_(ring_size(options.frame_slots)),
      proposals_(ring_size(options.proposal_slots)),
      keyframes_(ring_size(options.proposal_slots)),
      loops_(ring_size(options.proposal_slots)),
      request_pool_(kRequests),
      requests_(kRequests),
      answers_(kRequests),
      snapshots_(options.checkpoint.period > 0 ? 3 : 2, mapping_.publish()),
      places_(1, loop_closing_.places()),
      checkpoints_(rig, options.checkpoint),
      pacer_(options.pacing) {
  consumed_.reserve(ring_size(options.proposal_slots));
  loop_messages_.reserve(ring_size(options.proposal_slots));
}

void ThreadedRun::run(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                      const ProgressSink& progress) {
  loop_closer_.emplace(
      WorkerOptions{.name = "loop closer", .cpu = options_.loop_closer_cpu, .fifo_priority = {}},
      [this](std::stop_token stop) { loop_closer_thread(stop); });
  mapper_.emplace(WorkerOptions{.name = "mapper", .cpu = options_.mapper_cpu, .fifo_priority = {}},
                  [this](std::stop_token stop) { mapper_thread(stop); });
  tracker_.emplace(
      WorkerOptions{.name = "tracker", .cpu = options_.tracker_cpu, .fifo_priority = options_.fifo_priority},
      [this](std::stop_token stop) { tracker_thread(stop); });
  if (checkpoints_.enabled()) {
    checkpointer_.emplace(WorkerOptions{.name = "checkpoints", .cpu = {}, .fifo_priority = {}},
                          [this](std::stop_token stop) { checkpoint_thread(stop); });
  }
  read_frames(feed, interrupted, progress);
  join_threads();
  collect_records(progress);
}

// ------------------------------------------------------------------------------------------------ calling
// thread

void ThreadedRun::read_frames(const FrameFeed& feed, const std::atomic<bool>& interrupted,
                              const ProgressSink& progress) {
  SlotHandle previous;  // kept back until the time stamp of its successor is known
  FeedStatus status = FeedStatus::kEnd;
  // Relaxed: the flag carries no other data.
  while (!interrupted.load(std::memory_order_relaxed)) {
    SlotHandle slot = free_slot(progress);
    if (!slot || (status = feed(slot->frame)) != FeedStatus::kFrame) break;
    if (previous) {
      previous->next_t_ns = slot->frame.t_ns;
      send(std::move(previous));
    }
    slot->next_t_ns.reset();
    previous = std::move(slot);
  }
  if (previous) send(std::move(previous));
  result_.interrupted = interrupted.load(std::memory_order_relaxed);
  if (status == FeedStatus::kError) result_.error = "the input ended with an error";
  frames_ended_.store(true, std::memory_order_release);
  tracker_parking_.wake();
}

void ThreadedRun::send(SlotHandle slot) {
  TWOFOLD_CHECK(frames_.try_push(std::move(slot)), "the ring holds every slot of the pool");
  tracker_parking_.wake();
}

/// As fast as possible means as fast as the map can follow: without a clock to keep, frames wait for the
/// mapper.
bool ThreadedRun::must_hold_back() const {
  return options_.pacing.speed == 0 && proposals_.size_approx() > 1;
}

bool ThreadedRun::any_thread_failed() const {
  return (tracker_->finished() && !frames_ended_.load(std::memory_order_relaxed)) ||
         (mapper_->finished() && !proposals_ended_.load(std::memory_order_acquire));
}

/// Empty only when a thread failed.
ThreadedRun::SlotHandle ThreadedRun::free_slot(const ProgressSink& progress) {
  for (;;) {
    collect_records(progress);
    if (any_thread_failed()) return {};
    if (!must_hold_back()) {
      if (SlotHandle slot = slots_.try_acquire()) return slot;
    }
    const auto ready = [this] { return done_.size_approx() > 0 && !must_hold_back(); };
    (void)reader_parking_.wait_until({}, std::chrono::steady_clock::now() + kFailureCheck, ready);
  }
}

void ThreadedRun::collect_records(const ProgressSink& progress) {
  SlotHandle slot;
  while (done_.try_pop(slot)) {
    const FrameRecord& record = slot->record;
    ++progress_.frames;
    progress_.lost += record.state == FrameState::kLost;
    progress_.dropped += record.state == FrameState::kDropped;
    progress_.keyframes += record.keyframe;
    progress_.tracked_share = record.tracked_share;
    progress_.map_version = map_version_.load(std::memory_order_relaxed);
    progress_.queued = proposals_.size_approx();
    result_.frames.push_back(record);
    slot->frame = {};  // images are freed here, not on the tracker's thread
    slot.reset();
    if (progress) progress(progress_);
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
  take_messages();
  if (loop_messages_.empty()) return;
  const MapperRound round = mapping_.step({}, loop_messages_);
  (void)mapping_.publish();
  schedule_.mapper.append({round.version, 0, static_cast<std::uint32_t>(loop_messages_.size())});
  result_.rounds.push_back(round);
}

RunResult ThreadedRun::finish() {
  map_late_loops();
  result_.graph = mapping_.finish();
  result_.places = loop_closing_.places();
  result_.checkpoints = checkpoints_.report();
  result_.times.push_back(std::move(tracking_.times()));
  result_.times.push_back(std::move(mapping_.times()));
  result_.times.push_back(std::move(loop_closing_.times()));
  result_.loops = std::move(loop_closing_.loops());
  result_.schedule = std::move(schedule_);
  result_.trace = std::move(trace_);
  result_.keyframes_not_described = not_described_.load(std::memory_order_relaxed);
  return std::move(result_);
}

// -----------------------------------------------------------------------------------------------------
// tracker

void ThreadedRun::tracker_thread(const std::stop_token& stop) {
  SlotHandle slot;
  const auto ready = [&] { return frames_.try_pop(slot) || frames_ended_.load(std::memory_order_acquire); };
  while (tracker_parking_.wait(stop, ready)) {
    if (!slot && !frames_.try_pop(slot)) break;  // ended, and nothing was pushed before that
    const Arrival arrival = pacer_.wait_for(slot->frame.t_ns, slot->next_t_ns, stop);
    slot->record = FrameRecord{};
    if (arrival.drop) {
      slot->record.frame_index = slot->frame.index;
      slot->record.t_ns = slot->frame.t_ns;
      slot->record.state = FrameState::kDropped;
      schedule_.tracker.append({slot->frame.index, 0, TrackerStep::Fate::kDropped});
    } else {
      track(*slot, snapshots_.mailbox(kTrackerReader).latest());
      tracking_.finish(arrival.scheduled_ns, slot->record);
    }
    TWOFOLD_CHECK(done_.try_push(std::move(slot)), "the ring holds every slot of the pool");
    reader_parking_.wake();
  }
  spare_.reset();
}

void ThreadedRun::track(FrameSlot& slot, const GraphSnapshot& graph) {
  if (!spare_ && !options_.localise_only) spare_ = proposals_pool_.try_acquire();
  TrackerStep step{slot.frame.index, graph.version(), TrackerStep::Fate::kTracked};
  take_answers(step);
  step.degrade_level = spare_ ? 0 : 1;  // first rung of the ladder: keyframes are withheld
  if (tracking_.step(slot.frame, graph, spare_, slot.record)) send_proposal(slot.record, step);
  schedule_.tracker.append(step);
  ask_where_we_are();
}

void ThreadedRun::take_answers(TrackerStep& step) {
  RelocalisationAnswer answer;
  while (answers_.try_pop(answer)) {
    tracking_.take_answer(answer);
    ++step.messages;
  }
}

void ThreadedRun::ask_where_we_are() {
  if (!tracking_.wants_relocalisation()) return;
  RequestHandle request = request_pool_.try_acquire();
  TWOFOLD_CHECK(request, "the answer to the request before has come");
  (void)tracking_.request_relocalisation(*request);
  TWOFOLD_CHECK(requests_.try_push(std::move(request)), "one request is under way at most");
  loop_parking_.wake();
}

void ThreadedRun::send_proposal(FrameRecord& record, TrackerStep& step) {
  if (proposals_.try_push(std::move(spare_))) {
    mapper_parking_.wake();
    return;
  }
  // The mapper is behind by a whole ring: this keyframe is given up, its buffer kept.
  tracking_.proposal_rejected(record);
  step.refused = 1;
}

// ------------------------------------------------------------------------------------------------------
// mapper

void ThreadedRun::take_messages() {
  consumed_.clear();
  ProposalHandle proposal;
  while (consumed_.size() < consumed_.capacity() && proposals_.try_pop(proposal)) {
    consumed_.push_back(std::move(proposal));
  }
  loop_messages_.clear();
  LoopMessage message;
  while (loop_messages_.size() < loop_messages_.capacity() && loops_.try_pop(message)) {
    loop_messages_.push_back(std::move(message));
  }
}

void ThreadedRun::mapper_thread(const std::stop_token& stop) {
  const auto ready = [this] {
    return proposals_.size_approx() > 0 || loops_.size_approx() > 0 ||
           proposals_ended_.load(std::memory_order_acquire);
  };
  while (mapper_parking_.wait(stop, ready)) {
    take_messages();
    if (consumed_.empty() && loop_messages_.empty()) break;  // ended
    MapperRound round = mapping_.step(consumed_, loop_messages_);
    snapshots_.publish(mapping_.publish());
    map_version_.store(round.version, std::memory_order_relaxed);
    MapperStep step{round.version, static_cast<std::uint32_t>(round.proposals),
                    static_cast<std::uint32_t>(loop_messages_.size())};
    for (ProposalHandle& proposal : consumed_) {
      if (keyframes_.try_push(std::move(proposal))) continue;
      ++step.refused;
      not_described_.fetch_add(1, std::memory_order_relaxed);
    }
    consumed_.clear();
    loop_parking_.wake();
    reader_parking_.wake();
    schedule_.mapper.append(step);
    result_.rounds.push_back(round);  // read by others after the join only
  }
}

// ------------------------------------------------------------------------------------------------- loop
// closer

void ThreadedRun::loop_closer_thread(const std::stop_token& stop) {
  ProposalHandle keyframe;
  const auto ready = [&] {
    return keyframe || requests_.size_approx() > 0 || keyframes_.try_pop(keyframe) ||
           keyframes_ended_.load(std::memory_order_acquire);
  };
  while (loop_parking_.wait(stop, ready)) {
    if (answer_request()) continue;  // a lost camera comes first
    if (!keyframe && !keyframes_.try_pop(keyframe)) break;
    const GraphSnapshot& graph = snapshots_.mailbox(kLoopReader).latest();
    LoopStep step{graph.version(), static_cast<std::int64_t>(index(keyframe->id))};
    send_loops(loop_closing_.step(*keyframe, graph), step);
    publish_places();
    schedule_.loop_closer.append(step);
    keyframe.reset();
  }
}

bool ThreadedRun::answer_request() {
  RequestHandle request;
  if (!requests_.try_pop(request)) return false;
  const GraphSnapshot& graph = snapshots_.mailbox(kLoopReader).latest();
  RelocalisationAnswer answer = loop_closing_.relocalise(*request, graph);
  request.reset();  // before the answer: the next request finds its buffer free
  TWOFOLD_CHECK(answers_.try_push(std::move(answer)), "one request is under way at most");
  schedule_.loop_closer.append({graph.version(), -1, 1});
  return true;
}

void ThreadedRun::publish_places() {
  const PlaceBook& places = loop_closing_.places();
  if (checkpoints_.enabled() && places.version() > places_.newest()) places_.publish(places);
}

/// A ring that is full takes nothing more of this step; a loop that is lost is found again.
void ThreadedRun::send_loops(std::span<LoopMessage> messages, LoopStep& step) {
  std::size_t sent = 0;
  while (sent < messages.size() && loops_.try_push(std::move(messages[sent]))) ++sent;
  step.refused = static_cast<std::uint32_t>(messages.size() - sent);
  if (sent > 0) mapper_parking_.wake();
}

// ------------------------------------------------------------------------------------------------
// checkpoints

/// Reads the newest versions where they are, for as long as it takes: publishing goes on meanwhile, and the
/// versions read are destroyed by their writers when this thread asks for newer ones.
void ThreadedRun::checkpoint_thread(const std::stop_token& stop) {
  yield_to_other_threads();
  while (!stop.stop_requested()) {
    const auto due = std::chrono::steady_clock::now() + std::chrono::nanoseconds(checkpoints_.period_ns());
    (void)checkpoint_parking_.wait_until(stop, due, [] { return false; });
    if (stop.stop_requested()) return;  // the caller saves the final map
    checkpoints_.save(snapshots_.mailbox(kCheckpointReader).latest(), places_.mailbox(0).latest());
  }
}

}  // namespace twofold
