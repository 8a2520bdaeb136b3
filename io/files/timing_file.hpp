#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace twofold {

/// Durations between two bounds of a histogram.
struct TimingBucket {
  double from_us = 0, to_us = 0;
  std::uint64_t count = 0;
};

/// Distribution of one stage's durations, as LatencyHistogram::to_json writes it.
struct StageTimes {
  std::uint64_t count = 0;
  double mean_ms = 0, min_ms = 0, p50_ms = 0, p90_ms = 0, p99_ms = 0, p99_9_ms = 0, max_ms = 0;
  std::vector<TimingBucket> buckets;  ///< not empty ones, ascending; their counts add up to `count`
};

/// What the whole run cost.
struct RunCost {
  std::uint64_t frames = 0;
  double wall_seconds = 0, cpu_seconds = 0, peak_rss_mb = 0;
};

/// Frames tracked on one effort level.
struct FramesOnLevel {
  std::string name;
  std::uint64_t frames = 0;
};

/// One timing.json.
struct TimingFile {
  std::string name;                                                  ///< as given by the user
  std::map<std::string, std::map<std::string, StageTimes>> threads;  ///< thread -> stage -> times
  std::vector<FramesOnLevel> effort_levels;  ///< highest level first; empty in files of versions without it
  std::optional<RunCost> cost;  ///< missing in files of versions that kept it in summary.json only
};

/// Reads a timing.json, or the one in a run's folder. Throws IoError naming file, thread, stage and key, or
/// the line where the text stops being JSON.
[[nodiscard]] TimingFile read_timing(const std::filesystem::path& file);

/// Table of all stages, a line a stage and run, the runs of a stage below each other; behind each run after
/// the first how its p50 and p99 compare with the first one's. Ends with the effort levels and what the runs
/// cost.
[[nodiscard]] std::string timing_table(const std::vector<TimingFile>& runs);

}  // namespace twofold
