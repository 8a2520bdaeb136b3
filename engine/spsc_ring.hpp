#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>

#include "base/atomics.hpp"
#include "base/check.hpp"

namespace twofold {

/// Bounded first-in first-out ring between two threads.
///
/// Roles: one producer calls try_push, one consumer calls try_pop; size_approx may be called by anyone.
/// Progress: wait-free on both ends, a handful of instructions besides moving T; no allocation after
/// construction. Capacity: a power of two fixed at construction. Full: try_push returns false and leaves the
/// value untouched. Memory: `capacity` values of T. A popped slot keeps a moved-from T until it is
/// overwritten, so that T must give up what it owns when moved from (unique_ptr, vector, PoolHandle do).
/// Values left inside die with the ring.
///
/// Ordering. tail_ counts pushes, head_ counts pops; slot i % capacity belongs to the consumer while head_ <=
/// i < tail_, otherwise to the producer. (A) tail_ release (push) -> acquire (pop): the written slot is
/// visible to the consumer before it reads it. (B) head_ release (pop) -> acquire (push): the consumer's move
/// out of a slot is over before it is written again. Each thread reads its own counter relaxed, since it is
/// its only writer, and keeps a copy of the other's: a stale copy only understates what is free or filled,
/// and is refreshed before a refusal is reported. Counters of 64 bit never wrap.
template <class T, class Atomics = StdAtomics>
class SpscRing {
  static_assert(std::is_nothrow_move_assignable_v<T> && std::is_default_constructible_v<T>);

 public:
  explicit SpscRing(std::size_t capacity) : mask_(capacity - 1), slots_(std::make_unique<T[]>(capacity)) {
    TWOFOLD_CHECK(capacity > 0 && (capacity & mask_) == 0, "ring capacity must be a power of two");
  }
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  /// Producer. False when full; then `value` still holds what it held.
  [[nodiscard]] bool try_push(T&& value) {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail - head_seen_ > mask_) {
      head_seen_ = head_.load(std::memory_order_acquire);  // (B)
      if (tail - head_seen_ > mask_) return false;
    }
    slots_[tail & mask_] = std::move(value);
    tail_.store(tail + 1, std::memory_order_release);  // (A)
    return true;
  }

  /// Consumer. False when empty; then `value` is untouched.
  [[nodiscard]] bool try_pop(T& value) {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (!refresh(head)) return false;
    value = std::move(slots_[head & mask_]);
    head_.store(head + 1, std::memory_order_release);  // (B)
    return true;
  }

  /// Consumer. What try_pop would give, null when that is nothing; valid until the next try_pop.
  [[nodiscard]] const T* peek() {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    return refresh(head) ? &slots_[head & mask_] : nullptr;
  }

  /// Consumer. Whether a try_pop would succeed now.
  [[nodiscard]] bool has_value() { return refresh(head_.load(std::memory_order_relaxed)); }

  /// Fill level for counters and for choosing how much to do. Exact when neither end moves; the producer
  /// never sees less than the truth, the consumer never more. Relaxed: it publishes nothing. A third thread
  /// may see the counters out of step, hence the clamp.
  [[nodiscard]] std::size_t size_approx() const {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    return tail < head ? 0 : std::min(tail - head, capacity());
  }
  [[nodiscard]] std::size_t capacity() const { return mask_ + 1; }

 private:
  bool refresh(std::size_t head) {
    if (head != tail_seen_) return true;
    tail_seen_ = tail_.load(std::memory_order_acquire);  // (A)
    return head != tail_seen_;
  }

  using Counter = typename Atomics::template Atomic<std::size_t>;
  const std::size_t mask_;
  const std::unique_ptr<T[]> slots_;
  alignas(kCacheLine) Counter tail_{0};
  std::size_t head_seen_ = 0;  // producer's copy: spares a cache miss per push
  alignas(kCacheLine) Counter head_{0};
  std::size_t tail_seen_ = 0;  // consumer's copy
};

}  // namespace twofold
