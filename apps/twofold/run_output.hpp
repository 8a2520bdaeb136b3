#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/twofold/map_parts.hpp"
#include "engine/options.hpp"
#include "engine/result.hpp"
#include "io/sources/frame_source.hpp"

namespace twofold {

/// Where a run's frames came from, and went to.
struct RunFrames {
  std::string source;            ///< as given
  std::string recording;         ///< folder; empty: they were not recorded
  std::string calibration_file;  ///< given instead of the source's own; empty: none was
  nlohmann::ordered_json calibration =
      nullptr;                           ///< what was found from the video itself, if it was asked for
  std::vector<std::string> errors = {};  ///< of the run: what it failed of, and what was lost
};

/// RunResult::peak_rss_mb as it is by now: what comes after the run, a surface's mesh above all, may take
/// more memory than the run itself.
void update_peak_memory(RunResult& result);

/// Writes a run's folder: trajectory.txt (final), trajectory_causal.txt, keyframes.txt, with a loaded map
/// keyframes_loaded.txt, groundtruth.txt if
/// known (all TUM form), map.ply, timing.json, loop_latency.txt, summary.json, trajectory.png
/// (schedule.log is there already: RunLogs); trajectory, keyframes and map of parts that never joined the
/// first (map_parts) as trajectory-2.txt and so on. Throws IoError when it cannot.
/// @param surface  what summary.json says of the surface; null: there is none
void write_run_output(const std::filesystem::path& folder, const RunFrames& frames, const FrameSource& source,
                      const EngineOptions& options, const RunResult& result,
                      const std::vector<MapPart>& parts, const nlohmann::ordered_json& surface = nullptr);

/// Chrome/Perfetto trace; the run must have kept one.
void write_trace(const std::filesystem::path& file, const RunResult& result);

/// What a person wants to know, on standard output.
void print_summary(const std::filesystem::path& folder, const Rig& rig, const EngineOptions& options,
                   const RunResult& result, const std::vector<MapPart>& parts);

/// What the source left out, and why, on standard output.
void print_source_report(const SourceReport& report);

/// One camera does not show how long a metre is, unless it is localised in a map that a stereo or RGB-D rig
/// made.
[[nodiscard]] bool scale_is_arbitrary(const Rig& rig, const EngineOptions& options);

}  // namespace twofold
