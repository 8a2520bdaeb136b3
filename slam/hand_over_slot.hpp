#pragma once

#include <memory>

#include "base/atomics.hpp"

namespace twofold {

/// The newest object of one thread, for another that takes it away: from then on it alone has it, and
/// destroys it when it likes. An object that was not taken before the next is put is destroyed by whoever
/// puts that.
///
/// Roles: one thread calls put; take is called by one thread at a time. Progress: wait-free on both sides,
/// one exchange each, and what an object's end costs. Bound: one object waits.
///
/// Ordering.
/// (A) slot_ exchange, release in put -> acquire in take: the object is whole before it is seen.
/// (B) What put gets back was put by the same thread and never left the slot: no order is needed. take writes
///     null, which carries nothing.
template <class T, class Atomics = StdAtomics>
class HandOverSlot {
 public:
  HandOverSlot() = default;
  HandOverSlot(const HandOverSlot&) = delete;
  HandOverSlot& operator=(const HandOverSlot&) = delete;
  /// The threads have ended.
  ~HandOverSlot() { const std::unique_ptr<T> left = take(); }

  void put(std::unique_ptr<T> next) {
    const std::unique_ptr<T> never_seen(
        slot_.exchange(next.release(), std::memory_order_release));  // (A), (B)
  }
  /// Null when nothing was put since the last take.
  [[nodiscard]] std::unique_ptr<T> take() {
    return std::unique_ptr<T>(slot_.exchange(nullptr, std::memory_order_acquire));  // (A)
  }

 private:
  alignas(kCacheLine) typename Atomics::template Atomic<T*> slot_{nullptr};
};

}  // namespace twofold
