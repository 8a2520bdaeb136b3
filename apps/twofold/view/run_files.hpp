#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "evaluation/trajectory.hpp"
#include "io/files/io_error.hpp"
#include "io/files/ply.hpp"
#include "io/files/trajectory_file.hpp"
#include "viewer/wire_format.hpp"

namespace twofold {

using RunJson = nlohmann::json;

/// What a run wrote of one part of its map.
struct RunPart {
  Trajectory poses;  ///< of frames
  /// First those of the map that the run went on with, whose times are of other recordings, then its own, in
  /// the order of time.
  Trajectory keyframes;
  std::size_t loaded = 0;  ///< the former
  /// Numbers of the keyframes among those of all parts, in the same order.
  std::vector<std::uint32_t> ids;
  std::vector<PlyPoint> points;
  std::vector<ViewEdge> edges;  ///< between these numbers

  /// The run's own keyframes.
  [[nodiscard]] std::span<const TimedPose> own_keyframes() const {
    return std::span(keyframes).subspan(loaded);
  }
  /// Its first keyframe.
  [[nodiscard]] std::uint32_t name() const { return ids.empty() ? 0 : ids.front(); }
};

/// The largest first. Throws IoError naming the file that is missing or wrong.
[[nodiscard]] std::vector<RunPart> read_run_parts(const std::filesystem::path& folder);

/// Likewise.
[[nodiscard]] RunJson read_run_json(const std::filesystem::path& file);

}  // namespace twofold
