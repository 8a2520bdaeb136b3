#pragma once

#include <time.h>

#include <cstdint>

namespace twofold {

/// Processor time of the calling thread [ns]: what work costs, whatever else the machine does meanwhile.
[[nodiscard]] inline std::int64_t thread_cpu_ns() {
  timespec t{};
  (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return std::int64_t{1'000'000'000} * t.tv_sec + t.tv_nsec;
}

}  // namespace twofold
