#pragma once

#include <chrono>
#include <cstdint>

namespace twofold {

/// Monotonic time [ns] that durations, traces and pacing share (CLOCK_MONOTONIC, as V4L2 stamps its frames
/// with).
[[nodiscard]] inline std::int64_t steady_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace twofold
