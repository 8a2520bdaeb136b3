#pragma once

#include <chrono>
#include <cstdint>

namespace twofold {

/// `timeout_ns` from now; the clock's last moment, which is never, for a negative one and for one beyond it.
[[nodiscard]] inline std::chrono::steady_clock::time_point deadline_of(std::int64_t timeout_ns) {
  using Clock = std::chrono::steady_clock;
  const auto now = Clock::now();
  const std::chrono::nanoseconds timeout(timeout_ns);
  return timeout_ns < 0 || timeout > Clock::time_point::max() - now ? Clock::time_point::max()
                                                                    : now + timeout;
}

}  // namespace twofold
