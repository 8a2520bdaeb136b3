#pragma once

#include <cstdint>

namespace twofold {

/// What the process has used so far, as the kernel counts it.
struct ProcessUsage {
  double cpu_seconds = 0;           ///< user and system time of all threads, ended ones included
  std::int64_t peak_rss_bytes = 0;  ///< largest resident memory since the program was started
  std::int64_t rss_bytes = 0;       ///< resident memory now
};

/// Fields the kernel does not give stay 0.
[[nodiscard]] ProcessUsage process_usage();

}  // namespace twofold
