#include "engine/stepped_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "engine/thrown.hpp"
#include "imaging/image_buffers.hpp"

namespace twofold {
namespace {

// One request is under way at most; its buffer may be in the loop closer's hands when the next is made.
constexpr std::size_t kRequests = 2;

std::size_t ring_size(std::size_t wanted) {
  return std::bit_ceil(wanted);
}

/// Of whoever takes it.
const char* name_of(PipelineStep step) {
  switch (step) {
    case PipelineStep::kTrack:
      return "tracker";
    case PipelineStep::kMap:
      return "mapper";
    case PipelineStep::kCloseLoops:
      break;
  }
  return "loop closer";
}

}  // namespace

SteppedRun::Channels::Channels(const Rig& rig, const EngineOptions& options, const TrackerRunner& tracking,
                               MapperRunner& mapping, const LoopCloserRunner& loop_closing)
    : slots(options.frame_slots),
      // In the rings, in the two threads' hands, and the tracker's spare one.
      proposals(2 * ring_size(options.proposal_slots) + 4,
                [&](KeyframeProposal& proposal) { tracking.prepare(proposal); }),
      frames(ring_size(options.frame_slots)),
      done(ring_size(options.frame_slots)),
      mapper_inbox(ring_size(proposals.capacity()), ring_size(options.proposal_slots)),
      keyframes(ring_size(options.proposal_slots)),
      request_buffers(kRequests,
                      [&](RelocalisationRequest& request) { allocate_images(rig, request.images); }),
      requests(kRequests),
      answers(kRequests),
      snapshots(options.checkpoint.period > 0 ? 3 : 2, mapping.publish()),
      places(1, loop_closing.places()) {}

SteppedRun::SteppedRun(const Rig& rig, const EngineOptions& options, PacingClock* clock)
    : options_(options),
      rig_(rig),
      trace_(options.trace ? std::make_unique<Trace>() : nullptr),
      tracking_(rig, options, trace_.get()),
      mapping_(rig, options, trace_.get()),
      loop_closing_(rig, options, trace_.get()),
      logs_(options.logs, mapping_.replacement_log()),
      channels_(rig, options, tracking_, mapping_, loop_closing_),
      checkpoints_(rig, options.checkpoint),
      pacer_(options.pacing, clock),
      effort_controller_(options.effort, options.pacing.late) {}

void SteppedRun::begin_step(PipelineStep step) const {
  if (options_.before_step) options_.before_step(name_of(step));
}

bool SteppedRun::has_buffer() {
  if (!free_slot_) free_slot_ = channels_.slots.try_acquire();
  return static_cast<bool>(free_slot_);
}

bool SteppedRun::has_room() {
  return has_buffer() && !must_hold_back();
}

/// As fast as possible means as fast as the map and the disk can follow: without a clock to keep, frames wait
/// for them.
bool SteppedRun::must_hold_back() const {
  return !options_.pacing.keeps_pace() && (channels_.mapper_inbox.proposals_approx() > 1 || logs_.behind());
}

void SteppedRun::push(Frame frame) {
  TWOFOLD_CHECK(has_buffer(), "there is a buffer for the frame");
  logs_.note_input(rig_, frame);
  free_slot_->frame = std::move(frame);
  TWOFOLD_CHECK(channels_.frames.try_push(std::move(free_slot_)), "the ring holds every slot of the pool");
  tracker_parking_.wake();
}

void SteppedRun::collect(const FrameSink& sink) {
  SlotHandle slot;
  while (channels_.done.try_pop(slot)) {
    const FrameRecord& record = slot->record;
    progress_.count(record);
    progress_.map_version = map_version_.load(std::memory_order_relaxed);
    progress_.waiting = waiting();
    logs_.add(record, slot->correction);
    logs_.schedule().tracker.append(slot->step);
    slot->frame = {};  // images are freed here, not on the tracker's thread
    if (sink) sink(record, slot->correction);
    slot.reset();
  }
}

void SteppedRun::wait(std::chrono::steady_clock::time_point deadline) {
  const bool full = !has_room();
  const auto ready = [&] { return channels_.done.size_approx() > 0 || (full && has_room()); };
  (void)reader_parking_.wait_until({}, deadline, ready);
}

bool SteppedRun::failed() const {
  return step_failed_.load(std::memory_order_relaxed);
}

bool SteppedRun::step(PipelineStep step) {
  const auto which = static_cast<std::size_t>(step);
  const std::unique_lock turn(turns_[which], std::try_to_lock);
  if (!turn || steps_ended_ || failed()) return false;
  return take(step);
}

/// With its turn.
bool SteppedRun::take(PipelineStep step) {
  try {
    switch (step) {
      case PipelineStep::kTrack:
        return step_tracker();
      case PipelineStep::kMap:
        return step_mapper();
      case PipelineStep::kCloseLoops:
        return step_loop_closer();
    }
    return false;
  } catch (...) {
    failure_[static_cast<std::size_t>(step)] = fmt::format("{}: {}", name_of(step), what_was_thrown());
    step_failed_.store(true, std::memory_order_relaxed);
    throw;
  }
}

void SteppedRun::stop() {
  const std::scoped_lock turns(turns_[0], turns_[1], turns_[2]);
  steps_ended_ = true;
  try {
    const auto take_one_each = [this] {
      const bool tracked = take(PipelineStep::kTrack);
      const bool mapped = take(PipelineStep::kMap);
      return take(PipelineStep::kCloseLoops) || tracked || mapped;
    };
    while (!failed() && take_one_each()) {
    }
  } catch (...) {  // kept in failure_, as of any step
  }
  for (const std::string& failure : failure_) {
    if (result_.error.empty()) result_.error = failure;
  }
}

RunResult SteppedRun::finish() {
  collect({});
  map_late_loops();
  logs_.close(mapping_.replacement_log(), result_);
  collect_results(tracking_, mapping_, loop_closing_, result_);
  result_.checkpoints = checkpoints_.report();
  result_.trace = std::move(trace_);
  result_.keyframes_not_described = not_described_.load(std::memory_order_relaxed);
  return std::move(result_);
}

/// The loop closer ends after the mapper: what it sent last is taken here, all steps being over.
void SteppedRun::map_late_loops() {
  MapperInbox& inbox = channels_.mapper_inbox;
  (void)inbox.take();
  if (inbox.loops().empty()) return;
  const std::uint64_t version = mapping_.step({}, inbox.loops());
  (void)mapping_.publish();
  logs_.schedule().mapper.append({version, 0, static_cast<std::uint32_t>(inbox.loops().size())});
}

// The tracker's step: no lock, no allocation, no input or output.

bool SteppedRun::step_tracker() {
  SlotHandle slot;
  if (!channels_.frames.try_pop(slot)) return false;
  const Arrival arrival = pacer_.wait_for(slot->frame.t_ns, [this] { return successor_t_ns(); });
  const RightOfWayTaken way(options_.pacing.keeps_pace() ? options_.right_of_way : nullptr);
  begin_step(PipelineStep::kTrack);
  slot->record = FrameRecord{};
  slot->correction.reason = CorrectionReason::kNone;
  if (effort_controller_.must_drop(arrival)) {
    drop(*slot);
  } else {
    track(*slot, arrival, channels_.snapshots.mailbox(kTrackerReader).latest());
  }
  TWOFOLD_CHECK(channels_.done.try_push(std::move(slot)), "the ring holds every slot of the pool");
  reader_parking_.wake();
  return true;
}

/// Of the frame that waits behind the one in hand.
std::optional<std::int64_t> SteppedRun::successor_t_ns() {
  const SlotHandle* const next = channels_.frames.peek();
  if (next == nullptr) return std::nullopt;
  return (*next)->frame.t_ns;
}

void SteppedRun::drop(FrameSlot& slot) {
  slot.record.frame_index = slot.frame.index;
  slot.record.t_ns = slot.frame.t_ns;
  slot.record.state = FrameState::kDropped;
  slot.record.effort = effort_controller_.effort();
  slot.step = {slot.frame.index, 0, TrackerStep::Fate::kDropped,
               static_cast<std::uint8_t>(effort_controller_.effort())};
  effort_controller_.dropped();
}

void SteppedRun::track(FrameSlot& slot, const Arrival& arrival, const GraphSnapshot& graph) {
  prepare_spare();
  TrackerStep& step = slot.step;
  step = {slot.frame.index, graph.version(), TrackerStep::Fate::kTracked};
  take_answers(step);
  step.effort_level = static_cast<std::uint8_t>(effort_controller_.effort());
  step.keyframe_withheld = !spare_;
  tracking_.locate(slot.frame, graph, effort_controller_.effort(), spare_, slot.record);
  tracking_.tell(arrival.exposed_ns, pacer_.now_ns(), slot.record);
  if (tracking_.prepare_next(slot.record)) send_proposal();
  effort_controller_.tracked(pacer_.now_ns() - arrival.exposed_ns, arrival.period_ns);
  slot.correction = tracking_.correction();
  ask_where_we_are();
}

/// A buffer for a keyframe, if there may be one.
void SteppedRun::prepare_spare() {
  if (!tracking_.may_propose()) {
    spare_.reset();
  } else if (!spare_) {
    spare_ = channels_.proposals.try_acquire();
  }
}

void SteppedRun::take_answers(TrackerStep& step) {
  RelocalisationAnswer answer;
  while (channels_.answers.try_pop(answer)) {
    tracking_.take_answer(answer);
    ++step.messages;
  }
}

void SteppedRun::send_proposal() {
  channels_.mapper_inbox.send(std::move(spare_));
  mapper_parking_.wake();
}

void SteppedRun::ask_where_we_are() {
  if (!tracking_.wants_relocalisation()) return;
  RequestHandle request = channels_.request_buffers.try_acquire();
  TWOFOLD_CHECK(request, "the answer to the request before has come");
  (void)tracking_.request_relocalisation(*request);
  TWOFOLD_CHECK(channels_.requests.try_push(std::move(request)), "one request is under way at most");
  loop_parking_.wake();
}

// The mapper's step.

bool SteppedRun::step_mapper() {
  if (!channels_.mapper_inbox.take()) return false;
  begin_step(PipelineStep::kMap);
  const std::span<ProposalHandle> proposals = channels_.mapper_inbox.proposals();
  const std::span<const LoopMessage> loops = channels_.mapper_inbox.loops();
  const std::uint64_t version = mapping_.step(proposals, loops);
  {
    const ScopedStage timed = mapping_.timed_publication();
    channels_.snapshots.publish(mapping_.publish());
  }
  map_version_.store(version, std::memory_order_relaxed);
  logs_.schedule().mapper.append(
      {version, static_cast<std::uint32_t>(proposals.size()), static_cast<std::uint32_t>(loops.size())});
  for (ProposalHandle& proposal : proposals) {
    // The loop closer may be behind by a whole ring: it then does not get to know this keyframe, which goes
    // back to its pool here.
    ProposalHandle described = std::move(proposal);
    if (!channels_.keyframes.try_push(std::move(described)))
      not_described_.fetch_add(1, std::memory_order_relaxed);
  }
  loop_parking_.wake();
  reader_parking_.wake();
  // Last: nobody waits for it.
  const ScopedStage timed = mapping_.timed_release();
  channels_.snapshots.collect();
  return true;
}

// The loop closer's step.

bool SteppedRun::step_loop_closer() {
  if (answer_request()) return true;  // a lost camera comes first
  ProposalHandle keyframe;
  if (!channels_.keyframes.try_pop(keyframe)) return false;
  begin_step(PipelineStep::kCloseLoops);
  const GraphSnapshot& graph = channels_.snapshots.mailbox(kLoopReader).latest();
  LoopStep step{graph.version(), static_cast<std::int64_t>(index(keyframe->id))};
  send_loops(loop_closing_.step(*keyframe, graph), step);
  publish_places();
  logs_.schedule().loop_closer.append(step);
  return true;
}

bool SteppedRun::answer_request() {
  RequestHandle request;
  if (!channels_.requests.try_pop(request)) return false;
  answering_ = true;
  begin_step(PipelineStep::kCloseLoops);
  const GraphSnapshot& graph = channels_.snapshots.mailbox(kLoopReader).latest();
  RelocalisationAnswer answer = loop_closing_.relocalise(*request, graph);
  request.reset();  // before the answer: the next request finds its buffer free
  send_answer(std::move(answer), {graph.version(), -1, 1});
  return true;
}

bool SteppedRun::answer_nothing() {
  RequestHandle request;
  if (!answering_ && !channels_.requests.try_pop(request)) return false;
  request.reset();
  send_answer(std::nullopt, {channels_.snapshots.mailbox(kLoopReader).latest().version(), -1, 1, 1});
  return true;
}

void SteppedRun::send_answer(RelocalisationAnswer answer, const LoopStep& step) {
  TWOFOLD_CHECK(channels_.answers.try_push(std::move(answer)), "one request is under way at most");
  answering_ = false;
  tracker_parking_.wake();
  logs_.schedule().loop_closer.append(step);
}

/// A ring that is full takes nothing more of this step; a loop that is lost is found again. The mapper may
/// have the loop in the map as soon as it is sent: whoever is told of it is told before.
void SteppedRun::send_loops(std::span<LoopMessage> messages, LoopStep& step) {
  const std::span<LoopMessage> sent =
      messages.first(std::min(messages.size(), channels_.mapper_inbox.room_for_loops()));
  loop_closing_.sending(sent.size());
  for (LoopMessage& message : sent)
    TWOFOLD_CHECK(channels_.mapper_inbox.try_send(std::move(message)),
                  "only the mapper changes what room there is");
  step.refused = static_cast<std::uint32_t>(messages.size() - sent.size());
  if (!sent.empty()) mapper_parking_.wake();
}

void SteppedRun::publish_places() {
  const KeyframeDatabase& places = loop_closing_.places();
  if (checkpoints_.enabled() && places.version() > channels_.places.newest())
    channels_.places.publish(places);
  channels_.places.collect();
}

void SteppedRun::save_checkpoint() {
  checkpoints_.save(channels_.snapshots.mailbox(kCheckpointReader).latest(),
                    channels_.places.mailbox(0).latest());
}

}  // namespace twofold
