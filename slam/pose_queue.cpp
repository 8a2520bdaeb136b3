#include "twofold/pose_queue.hpp"

#include <atomic>
#include <bit>
#include <stdexcept>
#include <stop_token>
#include <string>

#include "engine/parking.hpp"
#include "engine/spsc_ring.hpp"
#include "slam/deadline.hpp"

namespace twofold {

struct TWOFOLD_HIDDEN PoseQueue::Impl {
  explicit Impl(std::size_t capacity) : ring(capacity) {}

  SpscRing<PoseOrEvent> ring;
  Parking reader, pacer;
  std::atomic<std::uint64_t> missed{0};  // relaxed: a count that publishes nothing
  std::stop_source closed;
};

namespace {

constexpr std::size_t kMostItems = std::size_t{1} << 24;

template <class Ready>
bool wait(Parking& parking, const std::stop_source& closed, std::int64_t timeout_ns, Ready&& ready) {
  return parking.wait_until(closed.get_token(), deadline_of(timeout_ns), ready);
}

}  // namespace

PoseQueue::PoseQueue(std::size_t capacity) {
  if (capacity < 1 || capacity > kMostItems)
    throw std::invalid_argument("a pose queue holds 1 to 16777216 items");
  impl_ = std::make_unique<Impl>(std::bit_ceil(capacity));
}
PoseQueue::~PoseQueue() = default;

void PoseQueue::put(const PoseOrEvent& item) {
  PoseOrEvent copy = item;
  if (!impl_->ring.try_push(std::move(copy))) {
    impl_->missed.fetch_add(1, std::memory_order_relaxed);
    return;
  }
  impl_->reader.wake();
}

QueueStatus PoseQueue::next(PoseOrEvent& item, std::int64_t timeout_ns) {
  auto& ring = impl_->ring;
  if (!wait(impl_->reader, impl_->closed, timeout_ns, [&] { return ring.has_value(); })) {
    // What was put before the queue was closed is seen after that.
    if (!closed()) return QueueStatus::kTimeout;
    if (!ring.has_value()) return QueueStatus::kEnd;
  }
  (void)ring.try_pop(item);
  impl_->pacer.wake();
  return QueueStatus::kItem;
}

void PoseQueue::close() {
  impl_->closed.request_stop();
}

bool PoseQueue::closed() const {
  return impl_->closed.stop_requested();
}

bool PoseQueue::wait_for_room(std::size_t items, std::int64_t timeout_ns) {
  const auto& ring = impl_->ring;
  if (items > ring.capacity())
    throw std::invalid_argument("a pose queue of " + std::to_string(ring.capacity()) +
                                " items never has room for " + std::to_string(items));
  const auto has_room = [&] { return ring.size_approx() + items <= ring.capacity(); };
  return wait(impl_->pacer, impl_->closed, timeout_ns, has_room) && !closed();
}

std::uint64_t PoseQueue::take_missed() {
  return impl_->missed.exchange(0, std::memory_order_relaxed);
}

}  // namespace twofold
