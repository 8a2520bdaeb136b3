#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/atomics.hpp"

namespace twofold {

/// The newest value of one writer, for any number of readers. T's copies are plain: they allocate nothing.
///
/// Roles: one writer calls put, anyone get. Progress: wait-free on both sides, no lock, no retry, no torn
/// value: a reader costs two counts and a copy.
///
/// state_ holds the slot that is newest (upper 8 bits) and how many readers have come to it (lower 56). A
/// reader learns the slot and counts itself in by the same addition, and counts itself out of the slot when
/// it has copied. The writer takes state_ over by an exchange, which tells how many readers ever came to the
/// slot before; it writes into a slot only when as many have left.
///
/// Bound: a reader that is stopped in the middle of its copy occupies one slot. If kSlots - 1 of them are
/// occupied, each by a reader that was stopped while another value was newest, or that has left without the
/// writer having seen it yet, put gives up: the value before stays the newest until the next put.
///
/// Ordering.
/// (A) state_ exchange, release in put -> addition, acquire in get: the slot's value is there before it is
///     read. Readers' additions in between continue the exchange's release sequence.
/// (B) left_ addition, release in get -> load, acquire in put: the copies are over before the slot is written
///     again. What the load sees contains all additions before it, by the same argument.
/// (C) Of the exchange the writer needs the count alone, which carries nothing: no acquire.
template <class T, class Atomics = StdAtomics, std::size_t kSlots = 8>
class LatestValue {
  static_assert(kSlots >= 2 && kSlots < 256);

 public:
  /// Writer. False when there is no free slot.
  bool put(const T& value) {
    for (std::size_t s = 0; s < kSlots; ++s) {
      if (s == newest_ || left_[s].load(std::memory_order_acquire) != entered_[s]) continue;  // (B)
      slots_[s] = value;
      const std::uint64_t before =
          state_.exchange(std::uint64_t{s} << kSlotShift, std::memory_order_release);  // (A), (C)
      entered_[newest_] += before & kCountMask;
      newest_ = s;
      return true;
    }
    return false;
  }

  /// Anyone. Nothing before the first put.
  [[nodiscard]] std::optional<T> get() const {
    const std::size_t s = state_.fetch_add(1, std::memory_order_acquire) >> kSlotShift;  // (A)
    std::optional<T> value = slots_[s];
    left_[s].fetch_add(1, std::memory_order_release);  // (B)
    return value;
  }

 private:
  static constexpr int kSlotShift = 56;
  static constexpr std::uint64_t kCountMask = (std::uint64_t{1} << kSlotShift) - 1;
  using Count = typename Atomics::template Atomic<std::uint64_t>;

  alignas(kCacheLine) mutable Count state_{0};
  alignas(kCacheLine) mutable std::array<Count, kSlots> left_{};  // readers that have left a slot, ever
  std::array<std::optional<T>, kSlots> slots_{};
  std::array<std::uint64_t, kSlots> entered_{};  // writer's: readers that came to a slot, ever
  std::size_t newest_ = 0;                       // writer's
};

}  // namespace twofold
