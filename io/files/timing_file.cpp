#include "io/files/timing_file.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;  // the effort levels come in their order

std::string read_text(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError(file, "cannot be opened");
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

Json parse(const fs::path& file) {
  const std::string text = read_text(file);
  try {
    return Json::parse(text);
  } catch (const Json::parse_error& e) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(e.byte, text.size()));
    const auto line = 1 + std::count(text.begin(), end, '\n');
    const bool ended = e.byte >= text.size();
    throw IoError(file, static_cast<int>(line),
                  ended ? "the file ends in the middle of the JSON text" : "this is not JSON");
  } catch (const Json::out_of_range&) {
    throw IoError(file, "holds a number too large for any duration or count");
  }
}

/// One JSON object and where it stands, for messages.
struct Node {
  const fs::path& file;
  std::string where;
  const Json& json;

  [[noreturn]] void fail(const std::string& problem) const {
    throw IoError(file, fmt::format("{}: {}", where, problem));
  }
  [[nodiscard]] const Json& at(const char* key) const {
    const auto found = json.find(key);
    if (found == json.end()) fail(fmt::format("'{}' is missing", key));
    return *found;
  }
  [[nodiscard]] double number(const char* key) const {
    const Json& value = at(key);
    if (!value.is_number() || !std::isfinite(value.get<double>()) || value.get<double>() < 0)
      fail(fmt::format("'{}' is no number >= 0", key));
    return value.get<double>();
  }
  [[nodiscard]] std::uint64_t count(const char* key) const {
    const Json& value = at(key);
    if (!value.is_number_unsigned()) fail(fmt::format("'{}' is no count", key));
    return value.get<std::uint64_t>();
  }
};

std::vector<TimingBucket> read_buckets(const Node& stage, std::uint64_t count) {
  std::vector<TimingBucket> buckets;
  const Json& list = stage.at("buckets");
  if (!list.is_array()) stage.fail("'buckets' is no list");
  std::uint64_t total = 0;
  for (const Json& item : list) {
    const bool fits = item.is_array() && item.size() == 3 && item[0].is_number() && item[1].is_number() &&
                      item[2].is_number_unsigned();
    if (!fits) stage.fail("'buckets' has an entry that is not [from_us, to_us, count]");
    const TimingBucket bucket{item[0].get<double>(), item[1].get<double>(), item[2].get<std::uint64_t>()};
    const double floor_us = buckets.empty() ? 0 : buckets.back().to_us;
    if (!(bucket.from_us >= floor_us && bucket.to_us > bucket.from_us))
      stage.fail("'buckets' are not in ascending order");
    total += bucket.count;
    buckets.push_back(bucket);
  }
  if (total != count) stage.fail(fmt::format("'buckets' hold {} durations, 'count' is {}", total, count));
  return buckets;
}

StageTimes read_stage(const Node& node) {
  if (!node.json.is_object()) node.fail("is no table of durations");
  StageTimes times;
  times.count = node.count("count");
  times.mean_ms = node.number("mean_ms");
  times.min_ms = node.number("min_ms");
  times.p50_ms = node.number("p50_ms");
  times.p90_ms = node.number("p90_ms");
  times.p99_ms = node.number("p99_ms");
  times.p99_9_ms = node.number("p99_9_ms");
  times.max_ms = node.number("max_ms");
  times.buckets = read_buckets(node, times.count);
  return times;
}

RunCost read_cost(const Node& node) {
  if (!node.json.is_object()) node.fail("is no table");
  return {node.count("frames"), node.number("wall_seconds"), node.number("cpu_seconds"),
          node.number("peak_rss_mb")};
}

std::vector<FramesOnLevel> read_effort_levels(const Node& node) {
  if (!node.json.is_object()) node.fail("is no table");
  const Json& frames = node.at("frames");
  if (!frames.is_object()) node.fail("'frames' is no table");
  std::vector<FramesOnLevel> effort_levels;
  for (const auto& [effort, count] : frames.items())
    effort_levels.push_back({effort, Node{node.file, node.where, frames}.count(effort.c_str())});
  return effort_levels;
}

/// "-12 %", of `value` against `base`; blank when the base is nothing.
std::string change(double value, double base) {
  if (!(base > 0)) return "";
  return fmt::format("{:+.0f} %", 100 * (value / base - 1));
}

std::string stage_rows(const std::vector<TimingFile>& runs, const std::string& thread,
                       const std::string& stage) {
  std::string rows;
  const StageTimes* first = nullptr;
  std::string label = stage;
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const auto stages = runs[n].threads.find(thread);
    if (stages == runs[n].threads.end()) continue;
    const auto found = stages->second.find(stage);
    if (found == stages->second.end()) continue;
    const StageTimes& t = found->second;
    std::string line =
        fmt::format("  {:<24} {:>3} {:>9} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f}", label,
                    n + 1, t.count, t.mean_ms, t.p50_ms, t.p90_ms, t.p99_ms, t.p99_9_ms, t.max_ms);
    if (first != nullptr && t.count > 0 && first->count > 0)
      line += fmt::format("   {:>7} {:>7}", change(t.p50_ms, first->p50_ms), change(t.p99_ms, first->p99_ms));
    if (first == nullptr) first = &t;
    label.clear();
    rows += line + "\n";
  }
  return rows;
}

std::string effort_rows(const std::vector<TimingFile>& runs) {
  std::string rows;
  for (std::size_t n = 0; n < runs.size(); ++n) {
    std::string line;
    for (const FramesOnLevel& effort : runs[n].effort_levels)
      line += fmt::format("{}{} {}", line.empty() ? "" : ", ", effort.name, effort.frames);
    if (!line.empty()) rows += fmt::format("  {:>3}  {}\n", n + 1, line);
  }
  return rows.empty() ? rows : "\nframes on the effort levels\n" + rows;
}

std::string cost_rows(const std::vector<TimingFile>& runs) {
  std::string rows;
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const auto& cost = runs[n].cost;
    if (!cost) {
      rows += fmt::format("  {:>3}  not in this file: see summary.json beside it\n", n + 1);
      continue;
    }
    const double frames = std::max<double>(1, static_cast<double>(cost->frames));
    rows +=
        fmt::format("  {:>3}  {} frames, {:.1f} s wall, {:.1f} s CPU ({:.2f} CPU-ms a frame), {:.0f} MB\n",
                    n + 1, cost->frames, cost->wall_seconds, cost->cpu_seconds,
                    1e3 * cost->cpu_seconds / frames, cost->peak_rss_mb);
  }
  return rows;
}

}  // namespace

TimingFile read_timing(const fs::path& given) {
  std::error_code ignored;
  const fs::path file = fs::is_directory(given, ignored) ? given / "timing.json" : given;
  if (!fs::is_regular_file(file, ignored)) throw IoError(file, "no such file");
  const Json root = parse(file);
  if (!root.is_object() || root.empty()) throw IoError(file, "holds no threads: not a timing.json");
  TimingFile timing;
  timing.name = given.string();
  for (const auto& [thread, stages] : root.items()) {
    if (thread == "run") {
      timing.cost = read_cost({file, thread, stages});
      continue;
    }
    if (thread == "effort levels") {
      timing.effort_levels = read_effort_levels({file, thread, stages});
      continue;
    }
    if (!stages.is_object()) Node{file, thread, stages}.fail("is no table of stages");
    for (const auto& [stage, times] : stages.items())
      timing.threads[thread][stage] = read_stage({file, thread + ", " + stage, times});
  }
  return timing;
}

std::string timing_table(const std::vector<TimingFile>& runs) {
  std::string text;
  for (std::size_t n = 0; n < runs.size(); ++n) text += fmt::format("run {}: {}\n", n + 1, runs[n].name);
  std::map<std::string, std::set<std::string>> threads;
  for (const TimingFile& run : runs) {
    for (const auto& [thread, stages] : run.threads) {
      for (const auto& [stage, times] : stages) threads[thread].insert(stage);
    }
  }
  for (const auto& [thread, stages] : threads) {
    text += fmt::format("\n{}\n  {:<24} {:>3} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}{}\n", thread,
                        "stage [ms]", "run", "count", "mean", "p50", "p90", "p99", "p99.9", "max",
                        runs.size() > 1 ? "       p50     p99 against run 1" : "");
    for (const std::string& stage : stages) text += stage_rows(runs, thread, stage);
  }
  return text + effort_rows(runs) + "\ncost\n" + cost_rows(runs);
}

}  // namespace twofold
