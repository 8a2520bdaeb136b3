#include "slam/slam_options.hpp"

#include <cmath>
#include <stdexcept>

#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

void expect(bool rule, const char* what) {
  if (!rule) throw std::invalid_argument(what);
}

/// That of the file that a run is going to write: known now, not after an hour of mapping.
bool has_folder(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path();
  return folder.empty() || std::filesystem::is_directory(folder);
}

void expect_sensible_pace(const SlamOptions& options) {
  const bool one_thread = options.mode == RunMode::kDeterministic || options.mode == RunMode::kReplay;
  expect(!options.live || !one_thread, "options.live needs RunMode::kThreaded or kStepped");
  expect(std::isfinite(options.speed) && options.speed >= 0, "options.speed must be finite and >= 0");
  expect(options.speed == 0 || (options.mode == RunMode::kThreaded && !options.live),
         "options.speed needs RunMode::kThreaded, without options.live");
  expect(!options.late || options.live || options.speed > 0, "options.late needs options.live or speed");
}

void expect_sensible_threads(const SlamOptions& options) {
  const auto is_cpu = [](const std::optional<int>& cpu) { return !cpu || *cpu >= 0; };
  expect(is_cpu(options.tracker_cpu), "options.tracker_cpu must be >= 0");
  expect(is_cpu(options.mapper_cpu), "options.mapper_cpu must be >= 0");
  expect(is_cpu(options.loop_closer_cpu), "options.loop_closer_cpu must be >= 0");
  const auto& priority = options.fifo_priority;
  expect(!priority || (*priority >= 1 && *priority <= 99), "options.fifo_priority must be in [1, 99]");
}

void expect_sensible(const SlamOptions& options) {
  expect(options.frame_buffers >= 2 && options.frame_buffers <= 65536,
         "options.frame_buffers must be in [2, 65536]");
  expect_sensible_threads(options);
  expect(options.kept_frames >= 1, "options.kept_frames must be >= 1");
  expect(options.run_folder.empty() || std::filesystem::is_directory(options.run_folder),
         "options.run_folder must be a folder");
  expect_sensible_pace(options);
  expect(options.schedule.empty() == (options.mode != RunMode::kReplay),
         "options.schedule and RunMode::kReplay belong together");
  std::error_code ignored;
  expect(options.run_folder.empty() ||
             !std::filesystem::equivalent(options.schedule, options.run_folder / "schedule.log", ignored),
         "options.schedule is in options.run_folder, where the replay would overwrite it");
  expect(!options.localise_only || !options.map.empty(), "options.localise_only needs options.map");
  expect(options.map.empty() || options.places,
         "options.map needs options.places, by which the camera finds itself in the map");
  expect(options.checkpoint.empty() || options.mode != RunMode::kStepped,
         "options.checkpoint is not for RunMode::kStepped: call save_map");
  expect(options.checkpoint_period > 0 && options.checkpoint_period <= 1e9,
         "options.checkpoint_period must be > 0 and <= 1e9");
  expect(has_folder(options.checkpoint), "options.checkpoint is in a folder that is not there");
  expect(has_folder(options.trace), "options.trace is in a folder that is not there");
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

EngineOptions engine_options(const SlamOptions& options) {
  expect_sensible(options);
  EngineOptions engine;
  engine.deterministic = options.mode == RunMode::kDeterministic;
  engine.stepped = options.mode == RunMode::kStepped;
  engine.pacing = {.speed = options.speed, .late = late_policy(options), .live = options.live};
  engine.localise_only = options.localise_only;
  engine.mapper.inner_window = options.inner_window;
  engine.mapper.outer_window = options.outer_window;
  if (const std::string why = engine.mapper.invalid_reason(); !why.empty())
    throw std::invalid_argument("options." + why);
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
  return engine;
}

}  // namespace twofold
