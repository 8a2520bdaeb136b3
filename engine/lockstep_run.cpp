#include "engine/lockstep_run.hpp"

#include <algorithm>
#include <bit>

#include "engine/thrown.hpp"

namespace twofold {
namespace {

// A replay queues what the threaded run had under way; its own limit must never be the tighter one.
constexpr std::size_t kReplayRoom = 64;
// A deterministic run maps and describes each proposal before the next frame.
constexpr std::size_t kDeterministicRoom = 6;

std::size_t pool_size(const EngineOptions& options) {
  return options.deterministic ? kDeterministicRoom : options.proposal_slots + kReplayRoom;
}

}  // namespace

LockstepRun::LockstepRun(const Rig& rig, const EngineOptions& options, std::optional<Schedule> schedule)
    : rig_(rig),
      trace_(options.trace ? std::make_unique<Trace>() : nullptr),
      tracking_(rig, options, trace_.get()),
      // As large as the threaded run's, so that frames take as long as there; those of a replay are many, and
      // few of them are ever used.
      pool_(pool_size(options),
            [&](KeyframeProposal& proposal) {
              if (options.deterministic) tracking_.prepare(proposal);
            }),
      mapping_(rig, options, trace_.get()),
      loop_closing_(rig, options, trace_.get()),
      logs_(options.logs, mapping_.replacement_log()),
      mapper_inbox_(std::bit_ceil(pool_size(options)), std::bit_ceil(pool_size(options))),
      schedule_(std::move(schedule)),
      checkpoints_(rig, options.checkpoint),
      snapshot_(mapping_.publish()) {
  if (schedule_) history_.push_back(snapshot_);
}

void LockstepRun::push(Frame frame) {
  if (failed()) return;
  try {
    take(frame);
  } catch (...) {
    fail(what_was_thrown());  // what the step had taken is gone: no other one may follow
    throw;
  }
}

void LockstepRun::take(const Frame& frame) {
  const bool is_first = !logs_.schedule().input;
  logs_.note_input(rig_, frame);
  if (is_first) expect_input_of_schedule();
  if (schedule_)
    replay(frame);
  else
    run_deterministically(frame);
}

void LockstepRun::collect(const FrameSink& sink) {
  if (!std::exchange(collected_, true) && sink) sink(record_, correction_);
}

void LockstepRun::run_deterministically(const Frame& frame) {
  track(frame, {.messages = answer_ ? 1U : 0U, .keyframe_withheld = !tracking_.may_propose()});
  if (request_) answer_request(snapshot_);
  if (const std::size_t proposals = mapper_inbox_.proposals_approx(); proposals > 0) {
    map(proposals, 0);
    close_loops(*mapped_.front(), snapshot_, 0);
    mapped_.clear();
    if (const std::size_t loops = mapper_inbox_.loops_approx(); loops > 0) map(0, loops);
  }
  checkpoint_if_due(frame.t_ns);
  count();
}

void LockstepRun::expect_input_of_schedule() {
  if (!schedule_ || !schedule_->input) return;
  if (const std::string why = mismatch(*schedule_->input, *logs_.schedule().input); !why.empty()) fail(why);
}

void LockstepRun::replay(const Frame& frame) {
  if (ended()) return;
  const TrackerStep& step = schedule_->tracker[next_frame_];
  if (frame.index > step.frame) {
    fail("the schedule belongs to another recording: frame numbers differ");
    return;
  }
  if (step.effort_level >= kEffortLevels) {
    fail("the schedule has an effort level that this program does not know");
    return;
  }
  if (frame.index < step.frame) {
    drop(frame, step);
  } else if (step.fate == TrackerStep::Fate::kDropped) {
    drop(frame, step);
    logs_.schedule().tracker.append(step);
    ++next_frame_;
  } else {
    if (!replay_rounds_until(step.version)) {
      end_replay("the mapper would need messages that were not sent");
      return;
    }
    if (step.messages > 0 && !answer_) {
      end_replay("the tracker would need an answer it did not ask for");
      return;
    }
    track(frame, step);
    ++next_frame_;
    replay_loop_steps();
    checkpoint_if_due(frame.t_ns);
  }
  count();
}

bool LockstepRun::replay_rounds_until(std::uint64_t version) {
  while (snapshot_.version() < version) {
    if (next_round_ == schedule_->mapper.size() || !can_map(schedule_->mapper[next_round_])) return false;
    replay_round(schedule_->mapper[next_round_++]);
  }
  return true;
}

void LockstepRun::replay_round(const MapperStep& round) {
  map(round.proposals, round.loop_messages);
  history_.push_back(snapshot_);
  replay_loop_steps();
}

void LockstepRun::end_replay(const char* why) {
  if (schedule_->ended) fail(std::string("the schedule does not fit the input: ") + why);
  next_frame_ = schedule_->tracker.size();
  next_round_ = schedule_->mapper.size();
}

bool LockstepRun::can_map(const MapperStep& round) const {
  return round.proposals <= mapper_inbox_.proposals_approx() &&
         round.loop_messages <= mapper_inbox_.loops_approx();
}

void LockstepRun::replay_loop_steps() {
  for (; next_loop_step_ < schedule_->loop_closer.size(); ++next_loop_step_) {
    const LoopStep& step = schedule_->loop_closer[next_loop_step_];
    if (step.version > snapshot_.version() || (step.requests > 0 && !request_)) return;
    while (history_.front().version() < step.version) history_.pop_front();
    if (step.requests > 0) {
      answer_request(history_.front(), step.refused > 0);
      continue;
    }
    if (mapped_.empty() || static_cast<std::int64_t>(index(mapped_.front()->id)) != step.keyframe) {
      fail("the schedule does not fit the input: the loop closer would need another keyframe");
      return;
    }
    close_loops(*mapped_.front(), history_.front(), step.refused);
    mapped_.pop_front();
  }
}

void LockstepRun::answer_request(const GraphSnapshot& graph, bool refused) {
  answer_ = refused ? RelocalisationAnswer() : loop_closing_.relocalise(*request_, graph);
  request_.reset();
  logs_.schedule().loop_closer.append({graph.version(), -1, 1, refused ? 1U : 0U});
}

void LockstepRun::close_loops(const KeyframeProposal& keyframe, const GraphSnapshot& graph,
                              std::size_t refused) {
  const std::span<LoopMessage> messages = loop_closing_.step(keyframe, graph);
  const std::size_t sent = messages.size() - std::min(refused, messages.size());
  loop_closing_.sending(sent);
  for (LoopMessage& message : messages.first(sent)) {
    if (!mapper_inbox_.try_send(std::move(message))) fail("the schedule leaves too many loops waiting");
  }
  logs_.schedule().loop_closer.append({graph.version(), static_cast<std::int64_t>(index(keyframe.id)), 0,
                                       static_cast<std::uint32_t>(messages.size() - sent)});
}

void LockstepRun::track(const Frame& frame, const TrackerStep& step) {
  const std::int64_t due_ns = steady_now_ns();
  if (step.messages > 0) {
    tracking_.take_answer(*answer_);
    answer_.reset();
  }
  record_ = FrameRecord{};
  ProposalHandle proposal;
  if (!step.keyframe_withheld) proposal = pool_.try_acquire();
  tracking_.locate(frame, snapshot_, static_cast<EffortLevel>(step.effort_level), proposal, record_);
  tracking_.tell(due_ns, steady_now_ns(), record_);
  if (tracking_.prepare_next(record_)) mapper_inbox_.send(std::move(proposal));
  correction_ = tracking_.correction();
  logs_.add(record_, correction_);
  TrackerStep taken = step;
  taken.frame = record_.frame_index;
  taken.version = record_.snapshot_version;
  logs_.schedule().tracker.append(taken);
  if (tracking_.wants_relocalisation()) (void)tracking_.request_relocalisation(request_.emplace());
}

void LockstepRun::drop(const Frame& frame, const TrackerStep& step) {
  record_ = FrameRecord{};
  record_.frame_index = frame.index;
  record_.t_ns = frame.t_ns;
  record_.state = FrameState::kDropped;
  record_.effort = static_cast<EffortLevel>(step.effort_level);
  correction_ = {};
  logs_.add(record_, correction_);
}

void LockstepRun::map(std::size_t proposals, std::size_t loop_messages) {
  (void)mapper_inbox_.take(proposals, loop_messages);
  const std::uint64_t version = mapping_.step(mapper_inbox_.proposals(), mapper_inbox_.loops());
  for (ProposalHandle& keyframe : mapper_inbox_.proposals()) {
    ProposalHandle mapped = std::move(keyframe);  // goes back to its pool here if nobody describes it
    if (is_described(mapped->id)) mapped_.push_back(std::move(mapped));
  }
  {
    const ScopedStage timed = mapping_.timed_publication();
    snapshot_ = mapping_.publish();
  }
  logs_.schedule().mapper.append(
      {version, static_cast<std::uint32_t>(proposals), static_cast<std::uint32_t>(loop_messages)});
}

bool LockstepRun::is_described(KeyframeId id) {
  if (!schedule_) return true;
  const std::vector<LoopStep>& steps = schedule_->loop_closer;
  const auto keyframe = static_cast<std::int64_t>(index(id));
  while (next_described_ < steps.size() && steps[next_described_].keyframe < keyframe) ++next_described_;
  if (next_described_ < steps.size() && steps[next_described_].keyframe == keyframe) return true;
  ++result_.keyframes_not_described;
  return false;
}

void LockstepRun::checkpoint_if_due(std::int64_t t_ns) {
  if (!checkpoints_.enabled()) return;
  const bool first = checkpoint_due_ns_ == std::numeric_limits<std::int64_t>::min();
  if (!first && t_ns < checkpoint_due_ns_) return;
  checkpoint_due_ns_ = t_ns + checkpoints_.period_ns();
  if (!first) checkpoints_.save(snapshot_, loop_closing_.places());
}

void LockstepRun::count() {
  logs_.wait_for_room();
  progress_.count(record_);
  progress_.map_version = snapshot_.version();
  progress_.waiting.keyframes = mapper_inbox_.proposals_approx();
  collected_ = false;
}

/// Of a replay: the rounds that came after the last frame.
void LockstepRun::stop() {
  if (!schedule_ || failed() || frames_due() > 0) return;
  for (; next_round_ < schedule_->mapper.size() && can_map(schedule_->mapper[next_round_]); ++next_round_)
    replay_round(schedule_->mapper[next_round_]);
}

RunResult LockstepRun::finish() {
  logs_.close(mapping_.replacement_log(), result_);
  collect_results(tracking_, mapping_, loop_closing_, result_);
  result_.checkpoints = checkpoints_.report();
  result_.trace = std::move(trace_);
  return std::move(result_);
}

}  // namespace twofold
