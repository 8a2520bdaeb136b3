// The tracker's thread of ThreadedRun: no lock, no allocation, no input or output.
#include "engine/threaded_run.hpp"

namespace twofold {

void ThreadedRun::tracker_thread(const std::stop_token& stop) {
  SlotHandle slot;
  const auto ready = [&] { return frames_.try_pop(slot) || frames_ended_.load(std::memory_order_acquire); };
  while (tracker_parking_.wait(stop, ready)) {
    // A handle that was moved from is empty (PoolHandle).  NOLINTNEXTLINE(bugprone-use-after-move)
    if (!slot && !frames_.try_pop(slot)) break;  // ended, and nothing was pushed before that
    const Arrival arrival = pacer_.wait_for(
        slot->frame.t_ns, [this] { return successor_t_ns(); }, stop);
    begin_step("tracker");
    slot->record = FrameRecord{};
    slot->correction.reason = CorrectionReason::kNone;
    if (effort_controller_.must_drop(arrival)) {
      drop(*slot);
    } else {
      track(*slot, arrival, snapshots_.mailbox(kTrackerReader).latest());
    }
    TWOFOLD_CHECK(done_.try_push(std::move(slot)), "the ring holds every slot of the pool");
    reader_parking_.wake();
  }
  spare_.reset();
}

/// Of the frame that waits behind the one in hand.
std::optional<std::int64_t> ThreadedRun::successor_t_ns() {
  const SlotHandle* const next = frames_.peek();
  if (next == nullptr) return std::nullopt;
  return (*next)->frame.t_ns;
}

void ThreadedRun::drop(FrameSlot& slot) {
  slot.record.frame_index = slot.frame.index;
  slot.record.t_ns = slot.frame.t_ns;
  slot.record.state = FrameState::kDropped;
  slot.record.effort = effort_controller_.effort();
  slot.step = {slot.frame.index, 0, TrackerStep::Fate::kDropped,
               static_cast<std::uint8_t>(effort_controller_.effort())};
  effort_controller_.dropped();
}

void ThreadedRun::track(FrameSlot& slot, const Arrival& arrival, const GraphSnapshot& graph) {
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
void ThreadedRun::prepare_spare() {
  // Relaxed: a wish, which takes effect with one frame or the next.
  const bool paused =
      options_.mapping_paused != nullptr && options_.mapping_paused->load(std::memory_order_relaxed);
  if (paused || options_.localise_only) {
    spare_.reset();
  } else if (!spare_) {
    spare_ = proposals_pool_.try_acquire();
  }
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

void ThreadedRun::send_proposal() {
  mapper_inbox_.send(std::move(spare_));
  mapper_parking_.wake();
}

}  // namespace twofold
