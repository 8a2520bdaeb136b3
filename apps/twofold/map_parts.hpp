#pragma once

#include <string>
#include <vector>

#include "engine/options.hpp"
#include "engine/result.hpp"
#include "io/trajectory.hpp"

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

/// Name of part n's file, n from 0: "map.ply", "map-2.ply", "map-3.ply".
[[nodiscard]] std::string part_file(const std::string& stem, std::size_t n, const std::string& extension);

}  // namespace twofold
