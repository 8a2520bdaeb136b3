#pragma once

#include <cstddef>
#include <memory>
#include <utility>

#include "base/atomics.hpp"
#include "base/check.hpp"

namespace twofold {

template <class T, class Atomics>
class FramePool;

namespace internal {

template <class T, class Atomics>
struct PoolSlot {
  T value;
  alignas(kCacheLine) typename Atomics::template Atomic<bool> in_use{false};
};

}  // namespace internal

/// Use of one object of a FramePool; gives it back when destroyed. Moves, through rings too; empty by default
/// and after being moved from. An object has one handle, used by one thread at a time.
template <class T, class Atomics = StdAtomics>
class PoolHandle {
 public:
  PoolHandle() = default;
  PoolHandle(PoolHandle&& other) noexcept : slot_(std::exchange(other.slot_, nullptr)) {}
  PoolHandle& operator=(PoolHandle&& other) noexcept {
    if (this != &other) {
      reset();
      slot_ = std::exchange(other.slot_, nullptr);
    }
    return *this;
  }
  ~PoolHandle() { reset(); }

  void reset() noexcept {
    if (slot_ == nullptr) return;
    slot_->in_use.store(false, std::memory_order_release);  // (A)
    slot_ = nullptr;
  }
  [[nodiscard]] explicit operator bool() const { return slot_ != nullptr; }
  [[nodiscard]] T& operator*() const { return slot_->value; }
  [[nodiscard]] T* operator->() const { return &slot_->value; }

 private:
  friend class FramePool<T, Atomics>;
  using Slot = internal::PoolSlot<T, Atomics>;
  explicit PoolHandle(Slot* slot) : slot_(slot) {}
  Slot* slot_ = nullptr;
};

/// Fixed number of objects made at start and used over and over, so that the steady state allocates nothing:
/// frames, pyramids, message bodies. An object keeps its contents, buffers included, between two uses.
///
/// Roles: one thread calls try_acquire; a handle is dropped on the thread that has it. All handles must be
/// gone, or never be used again, when the pool is destroyed. Progress: both wait-free. Dropping a handle is
/// one store; acquiring looks at each object at most once, starting behind the last one given out, which in
/// steady state is the first look. A ring of free objects for each dropping thread would do as well and need
/// one ring more for every thread. Full policy: an empty handle, and the caller drops or waits a frame.
///
/// Ordering. (A) in_use release (drop) -> acquire (try_acquire): the use is over before the next begins; uses
/// by the threads that had the handle before came to the last one with it, through a ring. Only the acquiring
/// thread sets in_use, hence no compare-and-swap.
template <class T, class Atomics = StdAtomics>
class FramePool {
 public:
  using Handle = PoolHandle<T, Atomics>;

  /// Calls prepare(object) once for each object, to size its buffers.
  template <class Prepare>
  FramePool(std::size_t capacity, Prepare&& prepare)
      : capacity_(capacity), slots_(std::make_unique<Slot[]>(capacity)) {
    TWOFOLD_CHECK(capacity > 0, "pool capacity");
    for (std::size_t i = 0; i < capacity; ++i) prepare(slots_[i].value);
  }
  explicit FramePool(std::size_t capacity) : FramePool(capacity, [](T&) {}) {}
  FramePool(const FramePool&) = delete;
  FramePool& operator=(const FramePool&) = delete;

  /// Acquiring thread. Empty handle when all objects are in use.
  [[nodiscard]] Handle try_acquire() {
    for (std::size_t looked = 0; looked < capacity_; ++looked) {
      Slot& slot = slots_[next_];
      next_ = next_ + 1 == capacity_ ? 0 : next_ + 1;
      if (slot.in_use.load(std::memory_order_acquire)) continue;  // (A)
      slot.in_use.store(true, std::memory_order_relaxed);         // nobody else sets it
      return Handle(&slot);
    }
    return {};
  }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }

 private:
  using Slot = internal::PoolSlot<T, Atomics>;
  const std::size_t capacity_;
  const std::unique_ptr<Slot[]> slots_;
  std::size_t next_ = 0;  // acquiring thread's
};

}  // namespace twofold
