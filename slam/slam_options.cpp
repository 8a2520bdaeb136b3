#include "slam/slam_options.hpp"

#include <stdexcept>

#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

void expect_sensible(const SlamOptions& options) {
  const auto expect = [](bool rule, const char* what) {
    if (!rule) throw std::invalid_argument(what);
  };
  expect(options.frame_buffers >= 2, "options.frame_buffers must be >= 2");
  expect(options.kept_frames >= 1, "options.kept_frames must be >= 1");
  expect(options.run_folder.empty() || std::filesystem::is_directory(options.run_folder),
         "options.run_folder must be a folder");
  const bool one_thread = options.mode == RunMode::kDeterministic || options.mode == RunMode::kReplay;
  expect(!options.live || !one_thread, "options.live needs RunMode::kThreaded or kStepped");
  expect(options.schedule.empty() == (options.mode != RunMode::kReplay),
         "options.schedule and RunMode::kReplay belong together");
  expect(!options.localise_only || !options.map.empty(), "options.localise_only needs options.map");
  expect(options.map.empty() || options.places,
         "options.map needs options.places, by which the camera finds itself in the map");
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
  engine.pacing.live = options.live;
  engine.pacing.late = LatePolicy::kNewest;
  engine.localise_only = options.localise_only;
  engine.mapper.inner_window = options.inner_window;
  engine.mapper.outer_window = options.outer_window;
  if (const std::string why = engine.mapper.invalid_reason(); !why.empty())
    throw std::invalid_argument("options: " + why);
  engine.frame_slots = static_cast<std::size_t>(options.frame_buffers);
  engine.logs.folder = options.run_folder;
  engine.logs.frames_in_memory = static_cast<std::size_t>(options.kept_frames);
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
