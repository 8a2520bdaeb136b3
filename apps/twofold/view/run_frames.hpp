#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/result.hpp"
#include "evaluation/trajectory.hpp"

namespace twofold {

/// A frame of a finished run.
struct RunFrame {
  std::uint32_t number = 0;
  std::int64_t t_ns = 0;
  FrameState state = FrameState::kTracked;
  float latency_ms = 0;   ///< from its exposure to its pose; 0: not known
  float tracking_ms = 0;  ///< that the tracker worked on it; 0: not known
  std::uint8_t effort = 0;
};

/// frames.txt: a line a frame, in their order: number, time stamp [ns], "tracked", "lost", "dropped" or
/// "placed later", exposure to pose [ms] (0 when the run kept no pace), tracking [ms], effort level. Throws
/// IoError when it cannot be written.
void write_run_frames(const std::filesystem::path& file, const RunResult& result, bool kept_pace);

/// Throws IoError naming the line that makes no sense.
[[nodiscard]] std::vector<RunFrame> read_run_frames(const std::filesystem::path& file);

/// Of a run that left no frames.txt: frames are counted, those that are named as lost or dropped left out,
/// and times of these lie evenly between those of the poses around them. Poses in the order of time.
/// @param lost, dropped  numbers of frames
[[nodiscard]] std::vector<RunFrame> counted_frames(const Trajectory& poses,
                                                   const std::vector<std::uint32_t>& lost,
                                                   const std::vector<std::uint32_t>& dropped);

}  // namespace twofold
