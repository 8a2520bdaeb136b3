#include "apps/twofold/map_options.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "apps/command_line.hpp"
#include "graph/map_place.hpp"
#include "graph/part_extraction.hpp"
#include "io/files/io_error.hpp"
#include "io/sources/resampled_source.hpp"
#include "slam/conversions.hpp"
#include "twofold/slam.hpp"

namespace twofold {
namespace {

void expect_sensible(const MapArguments& arguments, const EngineOptions& options) {
  if (arguments.localise_only && arguments.load.empty()) throw IoError("--localise-only", "needs --load-map");
  if (arguments.localise_only && !arguments.save.empty())
    throw IoError("--localise-only", "changes no map: there is nothing for --save-map to write");
  if (!(arguments.checkpoint >= 0))
    throw IoError("--checkpoint", fmt::format("must be a number of seconds, is {}", arguments.checkpoint));
  if (arguments.checkpoint > 0 && arguments.save.empty())
    throw IoError("--checkpoint", "needs --save-map, the file to write to");
  if (!arguments.initial_pose.empty() && arguments.load.empty())
    throw IoError("--initial-pose", "needs --load-map");
  if (!arguments.load.empty() && !options.vocabulary)
    throw IoError("--load-map", "needs places, by which the camera finds itself in the map");
  const std::filesystem::path folder = std::filesystem::path(arguments.save).parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder))  // known now, not after an hour of mapping
    throw IoError(arguments.save, "the folder is not there");
  if (!arguments.save.empty()) expect_place_for_map(arguments.save);
}

/// What is not exact is searched around it, as far as a robot at its dock may be off.
AssumedPose assumed_pose(const std::vector<double>& numbers) {
  const Pose pose{.q = {numbers[3], numbers[4], numbers[5], numbers[6]},
                  .t = {numbers[0], numbers[1], numbers[2]}};
  if (!is_rigid_motion(pose))
    throw IoError("--initial-pose", "is a position and a quaternion of length 1: X,Y,Z,QX,QY,QZ,QW");
  const InitialPose usual;
  return {kNoKeyframe, to_se3(pose), usual.position_sigma, usual.angle_sigma};
}

}  // namespace

SavedMap open_map(const std::string& file) {
  try {
    return load_map(file);
  } catch (const MapFileError& error) {
    throw IoError(error.what());
  }
}

void add_map_options(CLI::App& command, MapArguments& arguments) {
  command
      .add_option("--save-map", arguments.save,
                  "Write the map to this file (.tfm) at the end; parts that never joined it to "
                  "FILE-2.tfm, ...")
      ->check(empty_name);
  command.add_option("--checkpoint", arguments.checkpoint,
                     "Seconds after which the map is written to it during the run, again and again");
  command
      .add_option("--load-map", arguments.load,
                  "Go on with the map in this file, once a place of it is recognised")
      ->check(empty_name);
  command.add_flag("--localise-only", arguments.localise_only,
                   "Poses in the loaded map, which does not change");
  command
      .add_option("--initial-pose", arguments.initial_pose,
                  "Where the camera begins in the loaded map, as a line of trajectory.txt has it: "
                  "X,Y,Z,QX,QY,QZ,QW [m]. Searched first, believed where the map is found there")
      ->delimiter(',')
      ->expected(7);
}

void apply_map_options(const MapArguments& arguments, EngineOptions& options) {
  expect_sensible(arguments, options);
  options.localise_only = arguments.localise_only;
  options.checkpoint = {arguments.save, arguments.checkpoint};
  if (arguments.load.empty()) return;
  auto map = std::make_shared<const SavedMap>(open_map(arguments.load));
  if (map->places.size() == 0) {
    throw IoError(arguments.load, "knows no places, so that no camera can find itself in it");
  }
  options.map = std::move(map);
  if (!arguments.initial_pose.empty()) options.assumed_pose = assumed_pose(arguments.initial_pose);
}

std::unique_ptr<FrameSource> resampled_for_map(std::unique_ptr<FrameSource> source,
                                               const EngineOptions& options) {
  if (!options.map || !options.localise_only || source->rig().kind != SensorKind::kMono) return source;
  if (rig_difference(source->rig(), options.map->rig).empty()) return source;
  return std::make_unique<ResampledSource>(std::move(source), options.map->rig.camera);
}

void expect_rig_of_map(const MapArguments& arguments, const std::string& source, const Rig& rig,
                       const EngineOptions& options) {
  if (!options.map) return;
  const std::string difference = options.localise_only ? localisation_difference(rig, options.map->rig)
                                                       : rig_difference(rig, options.map->rig);
  if (difference.empty() && rig.kind != options.map->rig.kind && !options.localise_only)
    throw IoError(arguments.load, "is a stereo or RGB-D rig's: one camera needs --localise-only in it");
  if (difference.empty()) return;
  throw IoError(arguments.load, "made with another camera than that of " + source + ": " + difference);
}

std::uint32_t loaded_keyframe_ids(const EngineOptions& options) {
  return options.map ? options.map->graph.keyframe_count() : 0;
}

std::optional<std::int64_t> recognised_at(const EngineOptions& options, const RunResult& result) {
  if (!options.map) return std::nullopt;
  const GraphSnapshot& graph = result.graph;
  const KeyframeId loaded = oldest_part(graph);
  for (const FrameRecord& record : result.frames) {
    if (record.state != FrameState::kTracked || !graph.contains(record.reference)) continue;
    if (graph.part(record.reference) == loaded) return record.frame_index;
  }
  return std::nullopt;
}

}  // namespace twofold
