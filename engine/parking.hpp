#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>

#include "base/atomics.hpp"

namespace twofold {

/// The two futex calls. wait returns when woken, when `word` is not `expected`, after the timeout, or for no
/// reason.
struct Futex {
  static void wait(const std::atomic<std::uint32_t>& word, std::uint32_t expected,
                   std::optional<std::chrono::nanoseconds> timeout) noexcept;
  static void wake(const std::atomic<std::uint32_t>& word) noexcept;
};

/// Where ONE consumer thread sleeps until a condition that others bring about holds, such as "a ring has a
/// value".
///
/// Roles: any thread calls wake after it made the condition true; the one consumer calls the wait functions.
/// Progress: wake is wait-free; it makes a system call only when the consumer sleeps or is about to.
///
/// state_ holds a count of wakes (upper 31 bits) and whether the consumer is about to sleep (bit 0). Both
/// sides change it by read-modify-write, which are totally ordered, so of a wake and the consumer's
/// announcement one comes first:
///  - wake first: the announcement reads from its release sequence (acquire), so the consumer's next check
///    sees what the waker wrote before wake, and it does not sleep;
///  - announcement first: the waker finds bit 0 set and calls the futex, while the changed count keeps the
///    consumer from going to sleep if it was not yet asleep. Taking the announcement back reads from the wake
///    (acquire), so the check after sleeping sees what the waker wrote.
/// Therefore release in wake and acquire in the consumer's changes suffice; no seq_cst fence is needed. The
/// count would have to wrap, 2^31 wakes between announcement and futex call, to be mistaken for no wake.
/// std::atomic::wait of libstdc++ 12 gives no timeout, spins and yields before it sleeps, and shares its
/// sleeper counts between addresses.
class Parking {
 public:
  void wake() noexcept {
    if (state_.fetch_add(kOneWake, std::memory_order_release) & kSleeping) Futex::wake(state_);
  }

  /// Sleeps until ready() is true or a stop is requested; returns what ready() said last. ready is called on
  /// this thread, at least once, and may be woken for nothing.
  template <class Ready>
  [[nodiscard]] bool wait(const std::stop_token& stop, Ready&& ready) {
    return wait_impl(stop, std::nullopt, ready);
  }
  /// The same, but not beyond `deadline`.
  template <class Ready>
  [[nodiscard]] bool wait_until(const std::stop_token& stop, std::chrono::steady_clock::time_point deadline,
                                Ready&& ready) {
    return wait_impl(stop, deadline, ready);
  }

 private:
  static constexpr std::uint32_t kSleeping = 1;
  static constexpr std::uint32_t kOneWake = 2;

  template <class Ready>
  bool wait_impl(const std::stop_token& stop, std::optional<std::chrono::steady_clock::time_point> deadline,
                 Ready& ready) {
    if (ready()) return true;
    const std::stop_callback on_stop(stop, [this] { wake(); });
    for (;;) {
      const std::uint32_t announced = state_.fetch_or(kSleeping, std::memory_order_acquire) | kSleeping;
      bool done = ready();
      if (!done && !stop.stop_requested()) {
        std::optional<std::chrono::nanoseconds> timeout;
        if (deadline) timeout = *deadline - std::chrono::steady_clock::now();
        if (!timeout || timeout->count() > 0) {
          Futex::wait(state_, announced, timeout);
          state_.fetch_and(~kSleeping, std::memory_order_acquire);
          done = ready();
          if (!done && !stop.stop_requested()) continue;
          return done;
        }
      }
      // Relaxed: taking back the announcement tells nobody anything; a waker that still sees it wakes for
      // nothing.
      state_.fetch_and(~kSleeping, std::memory_order_relaxed);
      return done;
    }
  }

  alignas(kCacheLine) std::atomic<std::uint32_t> state_{0};
};

}  // namespace twofold
