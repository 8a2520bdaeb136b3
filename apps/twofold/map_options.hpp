#pragma once

#include <CLI/App.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/options.hpp"
#include "engine/result.hpp"
#include "graph/map_file.hpp"
#include "io/sources/frame_source.hpp"

namespace twofold {

/// Reads a map file; IoError names the section that is wrong.
[[nodiscard]] SavedMap open_map(const std::string& file);

/// What `twofold run` is told about map files.
struct MapArguments {
  std::string load;
  std::string save;
  double checkpoint = 0;  ///< [s], 0: none
  bool localise_only = false;
  /// T_w_c in the world of the loaded map: x y z [m], and the unit quaternion qx qy qz qw. Empty: not known.
  std::vector<double> initial_pose;
};

void add_map_options(CLI::App& command, MapArguments& arguments);

/// Loads the map and sets what the engine must know. Throws IoError for options that make no sense together,
/// files that are no maps, and maps in which no camera can find itself.
void apply_map_options(const MapArguments& arguments, EngineOptions& options);

/// The source itself, or, when its one camera is to be localised in a map of another one, its images at the
/// angular resolution of that.
[[nodiscard]] std::unique_ptr<FrameSource> resampled_for_map(std::unique_ptr<FrameSource> source,
                                                             const EngineOptions& options);

/// Throws IoError when `rig`, that of `source`, cannot be used in the loaded map.
void expect_rig_of_map(const MapArguments& arguments, const std::string& source, const Rig& rig,
                       const EngineOptions& options);

/// Keyframes of the loaded map, culled ones included: in the run's map they have the first ids. 0: none was.
[[nodiscard]] std::uint32_t loaded_keyframe_ids(const EngineOptions& options);

/// Index of the first frame that was tracked in the loaded map.
[[nodiscard]] std::optional<std::int64_t> recognised_at(const EngineOptions& options,
                                                        const RunResult& result);

}  // namespace twofold
