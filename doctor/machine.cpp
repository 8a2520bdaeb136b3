#include "doctor/machine.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include <fmt/format.h>

namespace twofold {
namespace {

namespace fs = std::filesystem;

constexpr int kFifoPriority = 50;  // what run --rt asks for
constexpr int kCapIpcLock = 14, kCapSysNice = 23;
constexpr double kTimerSlackNs = 50'000;  // the kernel's default

/// First line of a file; nothing when it cannot be read.
std::optional<std::string> first_line(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  if (!std::getline(in, line)) return std::nullopt;
  return line;
}

/// The rest of the first line that starts with `key`, without blanks and colon before it.
std::optional<std::string> value_of(const fs::path& file, const std::string& key) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t begin = line.find_first_not_of(" \t:", key.size());
    return begin == std::string::npos ? std::string() : line.substr(begin);
  }
  return std::nullopt;
}

std::set<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  std::set<std::string> found;
  for (std::string word; stream >> word;) found.insert(word);
  return found;
}

/// cpu0, cpu1, ... that have a folder.
std::vector<fs::path> cpu_folders(const fs::path& root) {
  std::vector<fs::path> folders;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(root / "sys/devices/system/cpu", error)) {
    const std::string name = entry.path().filename();
    if (name.size() > 3 && name.starts_with("cpu") &&
        name.find_first_not_of("0123456789", 3) == std::string::npos)
      folders.push_back(entry.path());
  }
  std::sort(folders.begin(), folders.end());
  return folders;
}

int allowed_cpus(const fs::path& root) {
  const auto list = value_of(root / "proc/self/status", "Cpus_allowed_list");
  int count = 0;
  std::istringstream parts(list.value_or(""));
  for (std::string part; std::getline(parts, part, ',');) {
    int first = 0, last = 0;
    const int read = std::sscanf(part.c_str(), "%d-%d", &first, &last);
    if (read == 1) ++count;
    if (read == 2) count += std::max(0, last - first + 1);
  }
  return count > 0 ? count : static_cast<int>(cpu_folders(root).size());
}

Finding check_cores(const fs::path& root) {
  const int count = allowed_cpus(root);
  if (count == 0) return {Health::kWarn, "cores", "unknown", "mount /proc and /sys"};
  if (count >= 2) return {Health::kOk, "cores", fmt::format("{} for this process", count), ""};
  return {Health::kWarn, "cores", "1 for this process: mapping will delay tracking",
          "give it two cores (taskset, docker --cpuset-cpus)"};
}

/// What /proc/cpuinfo calls the instructions that this build may use.
std::vector<std::string> wanted_features(const std::string& arch) {
  if (arch.starts_with("armv8")) return {"fp", "asimd"};
  std::vector<std::string> wanted{"sse4_2", "popcnt"};
  if (arch == "x86-64-v3" || arch == "x86-64-v4")
    wanted.insert(wanted.end(), {"avx2", "fma", "bmi2", "f16c"});
  if (arch == "x86-64-v4") wanted.insert(wanted.end(), {"avx512f", "avx512bw", "avx512vl"});
  return wanted;
}

Finding check_features(const fs::path& root) {
  const std::string arch = TWOFOLD_ARCH;
  const auto flags = value_of(root / "proc/cpuinfo", arch.starts_with("armv") ? "Features" : "flags");
  if (!flags)
    return {Health::kWarn, "processor", "features unknown", "mount /proc; the program needs " + arch};
  const std::vector<std::string> wanted = wanted_features(arch);
  const std::set<std::string> present = words(*flags);
  std::string missing;
  for (const std::string& flag : wanted) {
    if (!present.contains(flag)) missing += " " + flag;
  }
  if (missing.empty()) return {Health::kOk, "processor", "has what " + arch + " needs", ""};
  return {Health::kBad, "processor", "lacks" + missing + ", which this build (" + arch + ") needs",
          "build the preset release-v2"};
}

Finding check_governor(const fs::path& root) {
  std::map<std::string, int> governors;
  for (const fs::path& folder : cpu_folders(root)) {
    if (const auto governor = first_line(folder / "cpufreq/scaling_governor")) ++governors[*governor];
  }
  if (governors.empty()) return {Health::kOk, "governor", "none: the frequency is not managed here", ""};
  std::string text;
  for (const auto& [name, count] : governors)
    text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", name, count);
  if (governors.size() == 1 && governors.contains("performance")) return {Health::kOk, "governor", text, ""};
  return {Health::kWarn, "governor", text + ": slow to raise the frequency when a frame comes",
          "cpupower frequency-set -g performance"};
}

Finding check_clock(const fs::path& root) {
  const auto source = first_line(root / "sys/devices/system/clocksource/clocksource0/current_clocksource");
  if (!source) return {Health::kWarn, "clock source", "unknown", "mount /sys"};
  static const std::set<std::string> kFast{"tsc", "kvm-clock", "hyperv_clocksource_tsc_page",
                                           "arch_sys_counter"};
  if (kFast.contains(*source)) return {Health::kOk, "clock source", *source, ""};
  return {Health::kWarn, "clock source",
          *source + ": each reading of the clock is a system call of a microsecond",
          "boot with clocksource=tsc tsc=reliable if the processor's counter is steady"};
}

Finding check_timer_slack(const fs::path& root) {
  const auto text = first_line(root / "proc/self/timerslack_ns");
  if (!text) return {Health::kOk, "timer slack", "unknown", ""};
  const double slack_ns = std::strtod(text->c_str(), nullptr);
  const std::string state = fmt::format("{:g} us", 1e-3 * slack_ns);
  if (slack_ns <= kTimerSlackNs) return {Health::kOk, "timer slack", state, ""};
  return {Health::kWarn, "timer slack", state + ": sleepers wake so much later",
          "start from a shell or service with the default slack (systemd TimerSlackNSec=50us)"};
}

Finding check_load(const fs::path& root) {
  const auto text = first_line(root / "proc/loadavg");
  if (!text) return {Health::kOk, "load", "unknown", ""};
  const double load = std::strtod(text->c_str(), nullptr);
  const int cpus = std::max(1, allowed_cpus(root));
  const std::string state = fmt::format("{:.1f} on {} cores", load, cpus);
  if (load <= 0.5 * cpus) return {Health::kOk, "load", state, ""};
  return {Health::kWarn, "load", state + ": others use the cores, too", "end them, or use --rt and --pin"};
}

bool has_capability(const fs::path& root, int capability) {
  const auto text = value_of(root / "proc/self/status", "CapEff");
  return text && ((std::strtoull(text->c_str(), nullptr, 16) >> capability) & 1U) != 0;
}

/// Soft limit; nothing when unlimited, 0 when unknown.
std::optional<double> limit_of(const fs::path& root, const std::string& name) {
  const auto text = value_of(root / "proc/self/limits", name);
  if (!text) return 0;
  if (text->starts_with("unlimited")) return std::nullopt;
  return std::strtod(text->c_str(), nullptr);
}

Finding check_fifo(const fs::path& root) {
  const auto limit = limit_of(root, "Max realtime priority");
  if (has_capability(root, kCapSysNice) || !limit || *limit >= kFifoPriority)
    return {Health::kOk, "SCHED_FIFO", "permitted", ""};
  return {Health::kWarn, "SCHED_FIFO", fmt::format("not permitted (priority up to {:g})", *limit),
          "'@GROUP - rtprio 50' in /etc/security/limits.conf, or setcap cap_sys_nice+ep on the program"};
}

Finding check_locking(const fs::path& root) {
  const auto limit = limit_of(root, "Max locked memory");
  if (has_capability(root, kCapIpcLock) || !limit) return {Health::kOk, "locked memory", "permitted", ""};
  return {
      Health::kWarn, "locked memory", fmt::format("limited to {:.0f} kB", *limit / 1024),
      "'@GROUP - memlock unlimited' in /etc/security/limits.conf, or setcap cap_ipc_lock+ep on the program"};
}

}  // namespace

std::vector<Finding> check_machine(const fs::path& root) {
  return {check_cores(root),       check_features(root), check_governor(root), check_clock(root),
          check_timer_slack(root), check_load(root),     check_fifo(root),     check_locking(root)};
}

}  // namespace twofold
