#include "engine/health.hpp"

#include <ctime>
#include <fstream>
#include <limits>
#include <string>

namespace twofold {
namespace {

double process_cpu_seconds() {
  timespec time{};
  if (clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time) != 0) return 0;
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

ProcessUsage process_usage() {
  ProcessUsage usage;
  usage.cpu_seconds = process_cpu_seconds();
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

}  // namespace twofold
