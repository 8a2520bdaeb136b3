#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "engine/options.hpp"
#include "engine/result.hpp"
#include "evaluation/trajectory.hpp"

namespace twofold {

/// Part of a map that never joined the others: it has a world frame of its own, and is written to files of
/// its own.
struct MapPart {
  KeyframeId id{0};       ///< Keyframe::part
  int keyframes = 0;      ///< not culled
  Trajectory trajectory;  ///< frames tracked in it, with their final poses
};

/// First that of the loaded map, or, without one, that with most tracked frames. Never none: a run that
/// tracked nothing leaves an empty one.
[[nodiscard]] std::vector<MapPart> map_parts(const RunResult& result, const EngineOptions& options);

/// Writes each part to a map file of its own: `file`, then its name with -2, -3, ... for those that never
/// joined the first. Left out are further parts of a single keyframe, in which no camera could find itself.
/// @return  the files written
std::vector<std::string> save_parts(const std::filesystem::path& file, const Rig& rig,
                                    const RunResult& result, const std::vector<MapPart>& parts);

/// Name of part n's file, n from 0: "map.ply", "map-2.ply", "map-3.ply".
[[nodiscard]] std::string part_file(const std::string& stem, std::size_t n, const std::string& extension);
/// The same of a file with its folder.
[[nodiscard]] std::filesystem::path part_file(const std::filesystem::path& file, std::size_t n);

}  // namespace twofold
