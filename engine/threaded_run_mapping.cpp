// The threads of ThreadedRun behind the tracker: mapper, loop closer, checkpoints.
#include "engine/threaded_run.hpp"

namespace twofold {

void ThreadedRun::mapper_thread(const std::stop_token& stop) {
  const auto ready = [this] {
    return !mapper_inbox_.empty() || proposals_ended_.load(std::memory_order_acquire);
  };
  while (mapper_parking_.wait(stop, ready)) {
    if (!mapper_inbox_.take()) break;  // ended
    begin_step("mapper");
    const std::span<ProposalHandle> proposals = mapper_inbox_.proposals();
    const std::span<const LoopMessage> loops = mapper_inbox_.loops();
    const std::uint64_t version = mapping_.step(proposals, loops);
    {
      const ScopedStage timed = mapping_.timed_publication();
      snapshots_.publish(mapping_.publish());
    }
    map_version_.store(version, std::memory_order_relaxed);
    logs_.schedule().mapper.append(
        {version, static_cast<std::uint32_t>(proposals.size()), static_cast<std::uint32_t>(loops.size())});
    for (ProposalHandle& proposal : proposals) {
      // The loop closer may be behind by a whole ring: it then does not get to know this keyframe.
      if (!keyframes_.try_push(std::move(proposal))) not_described_.fetch_add(1, std::memory_order_relaxed);
      proposal.reset();
    }
    loop_parking_.wake();
    reader_parking_.wake();
  }
}

/// A loop closer that fails still answers the camera that asks where it is: nothing found.
void ThreadedRun::loop_closer_thread(const std::stop_token& stop) {
  try {
    close_loops(stop);
  } catch (...) {
    loop_closer_failed_.store(true, std::memory_order_relaxed);
    reader_parking_.wake();
    answer_nothing(stop);
    throw;
  }
}

void ThreadedRun::close_loops(const std::stop_token& stop) {
  ProposalHandle keyframe;
  const auto ready = [&] {
    return keyframe || requests_.size_approx() > 0 || keyframes_.try_pop(keyframe) ||
           keyframes_ended_.load(std::memory_order_acquire);
  };
  while (loop_parking_.wait(stop, ready)) {
    if (answer_request()) continue;  // a lost camera comes first
    if (!keyframe && !keyframes_.try_pop(keyframe)) break;
    begin_step("loop closer");
    const GraphSnapshot& graph = snapshots_.mailbox(kLoopReader).latest();
    LoopStep step{graph.version(), static_cast<std::int64_t>(index(keyframe->id))};
    send_loops(loop_closing_.step(*keyframe, graph), step);
    publish_places();
    logs_.schedule().loop_closer.append(step);
    keyframe.reset();
  }
}

bool ThreadedRun::answer_request() {
  RequestHandle request;
  if (!requests_.try_pop(request)) return false;
  answering_ = true;
  begin_step("loop closer");
  const GraphSnapshot& graph = snapshots_.mailbox(kLoopReader).latest();
  RelocalisationAnswer answer = loop_closing_.relocalise(*request, graph);
  request.reset();  // before the answer: the next request finds its buffer free
  send_answer(std::move(answer), {graph.version(), -1, 1});
  return true;
}

void ThreadedRun::send_answer(RelocalisationAnswer answer, const LoopStep& step) {
  TWOFOLD_CHECK(answers_.try_push(std::move(answer)), "one request is under way at most");
  answering_ = false;
  logs_.schedule().loop_closer.append(step);
}

void ThreadedRun::answer_nothing(const std::stop_token& stop) {
  RequestHandle request;
  const auto ready = [&] {
    return answering_ || requests_.try_pop(request) || keyframes_ended_.load(std::memory_order_acquire);
  };
  while (loop_parking_.wait(stop, ready)) {
    if (!answering_ && !request && !requests_.try_pop(request)) return;
    request.reset();
    send_answer(std::nullopt, {snapshots_.mailbox(kLoopReader).latest().version(), -1, 1, 1});
  }
}

void ThreadedRun::publish_places() {
  const KeyframeDatabase& places = loop_closing_.places();
  if (checkpoints_.enabled() && places.version() > places_.newest()) places_.publish(places);
}

/// A ring that is full takes nothing more of this step; a loop that is lost is found again.
void ThreadedRun::send_loops(std::span<LoopMessage> messages, LoopStep& step) {
  std::size_t sent = 0;
  while (sent < messages.size() && mapper_inbox_.try_send(std::move(messages[sent]))) ++sent;
  step.refused = static_cast<std::uint32_t>(messages.size() - sent);
  if (sent > 0) mapper_parking_.wake();
}

/// Reads the newest versions where they are, for as long as it takes: publishing goes on meanwhile, and the
/// versions read are destroyed by their writers when this thread asks for newer ones.
void ThreadedRun::checkpoint_thread(const std::stop_token& stop) {
  yield_to_other_threads();
  while (!stop.stop_requested()) {
    const auto due = std::chrono::steady_clock::now() + std::chrono::nanoseconds(checkpoints_.period_ns());
    (void)checkpoint_parking_.wait_until(stop, due, [] { return false; });
    if (stop.stop_requested()) return;  // the caller saves the final map
    begin_step("checkpoints");
    checkpoints_.save(snapshots_.mailbox(kCheckpointReader).latest(), places_.mailbox(0).latest());
  }
}

}  // namespace twofold
