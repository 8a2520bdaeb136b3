#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>

namespace twofold {

/// What the process has used so far, as the kernel counts it.
struct ProcessUsage {
  double cpu_seconds = 0;           ///< user and system time of all threads, ended ones included
  std::int64_t peak_rss_bytes = 0;  ///< largest resident memory since the program was started
  std::int64_t rss_bytes = 0;       ///< resident memory now
};

/// Fields the kernel does not give stay 0.
[[nodiscard]] ProcessUsage process_usage();

/// CPU time of the calling thread [s].
[[nodiscard]] double thread_cpu_seconds();
/// CPU time of a thread of this process by its kernel id [s]; nullopt when it has ended.
[[nodiscard]] std::optional<double> thread_cpu_seconds(pid_t thread);
/// Kernel id of the calling thread.
[[nodiscard]] pid_t this_thread_id();

}  // namespace twofold
