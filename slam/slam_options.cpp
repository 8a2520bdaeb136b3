#include "slam/slam_options.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "base/option_check.hpp"
#include "graph/part_extraction.hpp"
#include "loopclosure/default_vocabulary.hpp"
#include "slam/conversions.hpp"

namespace twofold {
namespace {

/// That of the file that a run is going to write: known now, not after an hour of mapping.
bool has_folder(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path();
  return folder.empty() || std::filesystem::is_directory(folder);
}

void check_initial_pose(const SlamOptions& o, OptionCheck& check) {
  if (!o.initial_pose) return;
  const InitialPose& pose = *o.initial_pose;
  check.rule(!o.map.empty(), "initial_pose needs options.map")
      .rule(is_rigid_motion(pose.T_world_camera),
            "initial_pose.T_world_camera must have finite numbers and a unit quaternion")
      .within("initial_pose.position_sigma", pose.position_sigma, 0, 10)
      .within("initial_pose.angle_sigma", pose.angle_sigma, 0, 1);
}

void check_pace(const SlamOptions& o, OptionCheck& check) {
  const bool one_thread = o.mode == RunMode::kDeterministic || o.mode == RunMode::kReplay;
  check.rule(!o.live || !one_thread, "live needs RunMode::kThreaded or kStepped")
      .that(std::isfinite(o.speed) && o.speed >= 0, "speed", "finite and >= 0", o.speed)
      .rule(o.speed == 0 || (o.mode == RunMode::kThreaded && !o.live),
            "speed needs RunMode::kThreaded, without options.live")
      .rule(!o.late || o.live || o.speed > 0, "late needs options.live or speed");
}

void check_threads(const SlamOptions& o, OptionCheck& check) {
  if (o.tracker_cpu) check.at_least("tracker_cpu", *o.tracker_cpu, 0);
  if (o.mapper_cpu) check.at_least("mapper_cpu", *o.mapper_cpu, 0);
  if (o.loop_closer_cpu) check.at_least("loop_closer_cpu", *o.loop_closer_cpu, 0);
  if (o.fifo_priority) check.within("fifo_priority", *o.fifo_priority, 1, 99);
}

void check_files(const SlamOptions& o, OptionCheck& check) {
  std::error_code ignored;
  check
      .rule(o.run_folder.empty() || std::filesystem::is_directory(o.run_folder),
            "run_folder must be a folder that is there, is " + o.run_folder.string())
      .rule(o.schedule.empty() == (o.mode != RunMode::kReplay),
            "schedule and RunMode::kReplay belong together")
      .rule(o.run_folder.empty() ||
                !std::filesystem::equivalent(o.schedule, o.run_folder / "schedule.log", ignored),
            "schedule is in options.run_folder, where the replay would overwrite it")
      .rule(!o.localise_only || !o.map.empty(), "localise_only needs options.map")
      .rule(o.map.empty() || o.places,
            "map needs options.places, by which the camera finds itself in the map")
      .rule(o.checkpoint.empty() || o.mode != RunMode::kStepped,
            "checkpoint is not for RunMode::kStepped: call save_map")
      .that(o.checkpoint_period > 0 && o.checkpoint_period <= 1e9, "checkpoint_period", "in (0, 1e9]",
            o.checkpoint_period)
      .rule(has_folder(o.checkpoint), "checkpoint is in a folder that is not there")
      .rule(has_folder(o.trace), "trace is in a folder that is not there");
}

AssumedPose assumed_pose(const InitialPose& pose, const GraphSnapshot& map) {
  if (pose.map_part != kNoId) {
    const auto parts = parts_of(map);
    if (std::find(parts.begin(), parts.end(), KeyframeId{pose.map_part}) == parts.end())
      throw std::invalid_argument(
          fmt::format("options.initial_pose.map_part is {}, which the map has no part of", pose.map_part));
  }
  return {pose.map_part == kNoId ? kNoKeyframe : KeyframeId{pose.map_part}, to_se3(pose.T_world_camera),
          pose.position_sigma, pose.angle_sigma};
}

LatePolicy late_policy(const SlamOptions& options) {
  switch (options.late.value_or(options.live ? LateFrames::kNewest : LateFrames::kQueue)) {
    case LateFrames::kQueue:
      return LatePolicy::kQueue;
    case LateFrames::kDrop:
      return LatePolicy::kDrop;
    case LateFrames::kNewest:
      break;
  }
  return LatePolicy::kNewest;
}

}  // namespace

Schedule schedule_to_replay(const SlamOptions& options) {
  auto schedule = load_schedule(options.schedule);
  if (!schedule) throw std::runtime_error(options.schedule.string() + ": " + schedule.error());
  return *std::move(schedule);
}

std::string SlamOptions::invalid_reason() const {
  OptionCheck check;
  check.within("frame_buffers", frame_buffers, 2, 65536)
      .at_least("kept_frames", static_cast<double>(kept_frames), 1)
      .at_least("inner_window", inner_window, 1)
      .at_least("outer_window", outer_window, 0);
  check_threads(*this, check);
  check_pace(*this, check);
  check_initial_pose(*this, check);
  check_files(*this, check);
  return check.reason();
}

EngineOptions engine_options(const SlamOptions& options) {
  if (const std::string why = options.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
  EngineOptions engine;
  engine.deterministic = options.mode == RunMode::kDeterministic;
  engine.stepped = options.mode == RunMode::kStepped;
  engine.pacing = {.speed = options.speed, .late = late_policy(options), .live = options.live};
  engine.localise_only = options.localise_only;
  engine.mapper.inner_window = options.inner_window;
  engine.mapper.outer_window = options.outer_window;
  engine.mapper.global.enabled = options.global_adjustment;
  engine.frame_slots = static_cast<std::size_t>(options.frame_buffers);
  engine.logs.folder = options.run_folder;
  engine.logs.frames_in_memory = static_cast<std::size_t>(options.kept_frames);
  if (!options.checkpoint.empty()) engine.checkpoint = {options.checkpoint, options.checkpoint_period};
  engine.trace = !options.trace.empty();
  engine.tracker_cpu = options.tracker_cpu;
  engine.mapper_cpu = options.mapper_cpu;
  engine.loop_closer_cpu = options.loop_closer_cpu;
  engine.fifo_priority = options.fifo_priority;
  if (options.places) {
    engine.vocabulary = std::make_shared<const Vocabulary>(
        options.vocabulary.empty() ? load_default_vocabulary() : Vocabulary::load(options.vocabulary));
  }
  if (!options.map.empty()) engine.map = std::make_shared<const SavedMap>(load_map(options.map));
  if (options.initial_pose) engine.assumed_pose = assumed_pose(*options.initial_pose, engine.map->graph);
  return engine;
}

}  // namespace twofold
