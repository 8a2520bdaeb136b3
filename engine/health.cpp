#include "engine/health.hpp"

#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>
#include <fstream>
#include <limits>
#include <string>

namespace twofold {
namespace {

std::optional<double> clock_seconds(clockid_t clock) {
  timespec time{};
  if (clock_gettime(clock, &time) != 0) return std::nullopt;
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

ProcessUsage process_usage() {
  ProcessUsage usage;
  usage.cpu_seconds = clock_seconds(CLOCK_PROCESS_CPUTIME_ID).value_or(0);
  // Not getrusage: its ru_maxrss survives exec, so that a small program started by a large one looks large.
  std::ifstream status("/proc/self/status");
  std::string key;
  while (status >> key) {
    std::int64_t kib = 0;
    if (key == "VmHWM:" && status >> kib) usage.peak_rss_bytes = kib * 1024;
    if (key == "VmRSS:" && status >> kib) usage.rss_bytes = kib * 1024;
    status.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return usage;
}

double thread_cpu_seconds() {
  return clock_seconds(CLOCK_THREAD_CPUTIME_ID).value_or(0);
}

std::optional<double> thread_cpu_seconds(pid_t thread) {
  // The kernel's numbering of per-thread CPU clocks. pthread_getcpuclockid gives the same, but for a thread
  // that has ended and is not joined yet its answer is the caller's own clock.
  constexpr clockid_t kPerThread = 4;
  constexpr clockid_t kScheduled = 2;
  return clock_seconds(static_cast<clockid_t>(static_cast<unsigned>(~thread) << 3U) | kPerThread |
                       kScheduled);
}

pid_t this_thread_id() {
  return static_cast<pid_t>(syscall(SYS_gettid));
}

}  // namespace twofold
