#include "apps/twofold/run_arguments.hpp"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <map>
#include <memory>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/command_line.hpp"
#include "io/files/io_error.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

const std::map<std::string, LatePolicy> kLatePolicies{
    {"queue", LatePolicy::kQueue}, {"drop", LatePolicy::kDrop}, {"newest", LatePolicy::kNewest}};

int parse_number(const std::string& text, const char* option) {
  int number = 0;
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, number);
  if (error == std::errc::result_out_of_range)
    throw IoError(option, fmt::format("'{}' is out of range", text));
  if (error != std::errc() || rest != end) throw IoError(option, fmt::format("'{}' is not a number", text));
  return number;
}

std::vector<int> parse_numbers(const std::string& text, std::size_t count, const char* option) {
  std::vector<int> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    numbers.push_back(parse_number(text.substr(begin, end - begin), option));
    begin = end + 1;
  }
  if (numbers.size() != count) throw IoError(option, fmt::format("needs {} numbers, got '{}'", count, text));
  return numbers;
}

/// What contradicts itself, or would do nothing.
void expect_consistent(const RunArguments& given) {
  const RunArguments unset;
  if (given.deterministic && given.speed != unset.speed)
    throw IoError("--speed", "has no meaning with --deterministic, which keeps no pace");
  if (given.deterministic && !given.replay_schedule.empty())
    throw IoError("--replay-schedule", "repeats another run's order, --deterministic has one of its own");
  if (given.poses_form != unset.poses_form && given.poses.empty())
    throw IoError("--poses-form", "needs --poses");
  if (given.window != unset.window) throw IoError("--window", "is for --estimator swf (--windows?)");
  if (given.calibration == "auto" && !given.map.load.empty() && !given.map.localise_only)
    throw IoError("--calib auto",
                  "finds other numbers each time, and who goes on with a map needs those that "
                  "it was made with: --calib calibration.yaml of that run, or --localise-only");
}

}  // namespace

void expect_options_of_filter(const RunArguments& given) {
  const RunArguments unset;
  const std::pair<const char*, bool> options_of_engine[] = {
      {"--poses", !given.poses.empty()},
      {"--poses-form", given.poses_form != unset.poses_form},
      {"--view", given.view.port.has_value()},
      {"--surface", given.surface.voxel > 0},
      {"--calib auto", given.calibration == "auto"},
      {"--save-map", !given.map.save.empty()},
      {"--checkpoint", given.map.checkpoint != 0},
      {"--load-map", !given.map.load.empty()},
      {"--localise-only", given.map.localise_only},
      {"--initial-pose", !given.map.initial_pose.empty()},
      {"--record", !given.record.empty()},
      {"--trace", !given.trace.empty()},
      {"--replay-schedule", !given.replay_schedule.empty()},
      {"--speed", given.speed != unset.speed},
      {"--late", given.late != unset.late},
      {"--pin", !given.pin.empty()},
      {"--rt", given.real_time},
      {"--windows", given.windows != unset.windows},
      {"--vocabulary", !given.vocabulary.empty()},
      {"--no-places", given.no_places},
      {"--no-metric-loops", given.no_metric_loops}};
  for (const auto& [option, is_given] : options_of_engine)
    if (is_given) throw IoError(option, "is not for --estimator swf");
}

namespace {

std::shared_ptr<const Vocabulary> vocabulary_of(const std::string& file) {
  try {
    return std::make_shared<const Vocabulary>(file.empty() ? load_default_vocabulary()
                                                           : Vocabulary::load(file));
  } catch (const std::runtime_error& error) {
    throw IoError(error.what());
  }
}

}  // namespace

EngineOptions engine_options(const RunArguments& arguments) {
  expect_consistent(arguments);
  EngineOptions options;
  options.deterministic = arguments.deterministic;
  options.trace = !arguments.trace.empty();
  if (arguments.speed != "max") {
    char* end = nullptr;
    options.pacing.speed = std::strtod(arguments.speed.c_str(), &end);
    if (*end != '\0' || !(options.pacing.speed > 0)) {
      throw IoError("--speed", fmt::format("must be 'max' or a positive number, is '{}'", arguments.speed));
    }
  }
  if (!arguments.late.empty()) options.pacing.late = kLatePolicies.at(arguments.late);
  const std::vector<int> windows = parse_numbers(arguments.windows, 2, "--windows");
  options.mapper.inner_window = windows[0];
  options.mapper.outer_window = windows[1];
  if (const std::string reason = options.mapper.invalid_reason(); !reason.empty())
    throw IoError("--windows", reason);
  if (!arguments.pin.empty()) {
    const std::vector<int> cpus = parse_numbers(arguments.pin, 3, "--pin");
    if (*std::min_element(cpus.begin(), cpus.end()) < 0)
      throw IoError("--pin", fmt::format("CPUs count from 0, got '{}'", arguments.pin));
    options.tracker_cpu = cpus[0];
    options.mapper_cpu = cpus[1];
    options.loop_closer_cpu = cpus[2];
  }
  if (arguments.real_time) options.fifo_priority = 50;
  options.mapper.loop.enabled = !arguments.no_metric_loops;
  if (!arguments.no_places) options.vocabulary = vocabulary_of(arguments.vocabulary);
  return options;
}

namespace {

void add_frame_options(CLI::App& command, RunArguments& arguments) {
  command
      .add_option("SOURCE", arguments.source,
                  "Path, or scheme:ARGUMENT?key=value (kitti, euroc, tum, 7scenes, replica, scannet, images, "
                  "video, mcap, bag, synthetic, v4l2); '...?first=N&frames=M': M frames of a recording, from "
                  "number N on")
      ->required();
  command
      .add_option("--calib", arguments.calibration,
                  "Calibration file instead of the recording's own; auto: found from the video "
                  "of one camera itself")
      ->check(empty_name);
  command
      .add_option("--camera", arguments.camera,
                  "all: what the source has; mono: its left camera alone, whose scale is arbitrary")
      ->check(CLI::IsMember({"all", "mono"}))
      ->capture_default_str();
  command.add_option("--out", arguments.out, "Folder for trajectories, map, timing")->capture_default_str();
  command
      .add_option("--speed", arguments.speed,
                  "Recorded seconds a second (1, 2, ...), or max; cameras set their own pace")
      ->capture_default_str();
  command
      .add_option("--late", arguments.late,
                  "Frames that are late, at a pace: queue (recordings do), drop, or newest (cameras do)")
      ->check(CLI::IsMember(kLatePolicies));
}

void add_estimator_options(CLI::App& command, RunArguments& arguments) {
  command.add_option("--windows", arguments.windows, "Keyframes in the inner and outer window")
      ->capture_default_str();
  command
      .add_option("--estimator", arguments.estimator,
                  "engine, or swf: the sliding window filter on stereo, for surface structure")
      ->check(CLI::IsMember({"engine", "swf"}))
      ->capture_default_str();
  command.add_option("--window", arguments.window, "Poses the sliding window filter keeps (0: all)")
      ->check(at_least_zero())
      ->capture_default_str();
}

void add_pose_options(CLI::App& command, RunArguments& arguments) {
  command.add_option("--poses", arguments.poses,
                     "Poses while they arise: - (standard output), FILE, udp:HOST:PORT, unix:PATH, "
                     "zmq:tcp://127.0.0.1:5556; may be repeated");
  command.add_option("--poses-form", arguments.poses_form, "json or tum, a line a frame")
      ->check(CLI::IsMember({"json", "tum"}))
      ->capture_default_str();
}

}  // namespace

void add_run_options(CLI::App& command, RunArguments& arguments) {
  add_frame_options(command, arguments);
  add_estimator_options(command, arguments);
  add_pose_options(command, arguments);
  command.add_option("--vocabulary", arguments.vocabulary, "Vocabulary file instead of the built-in one")
      ->check(empty_name);
  command
      .add_option("--record", arguments.record,
                  "Record the frames into this folder: the run can be repeated from it and schedule.log")
      ->check(empty_name);
  add_view_options(command, arguments.view);
  add_live_surface_options(command, arguments.surface);
  add_map_options(command, arguments.map);
  command.add_flag("--no-places", arguments.no_places, "Recognise no places: no large loops are closed");
  command.add_flag("--no-metric-loops", arguments.no_metric_loops,
                   "Close no small loops: for experiments with drift");
  command.add_flag("--deterministic", arguments.deterministic,
                   "One thread, one order: same input, same bytes");
  command
      .add_option("--replay-schedule", arguments.replay_schedule,
                  "Repeat the run that wrote this schedule.log, over the same recording, into another --out")
      ->check(empty_name);
  command.add_flag("--preload", arguments.preload, "Decode everything into memory before the clock starts");
  command.add_option("--trace", arguments.trace, "Write spans and counters for ui.perfetto.dev to this file")
      ->check(empty_name);
  command.add_option("--pin", arguments.pin, "CPUs of tracker, mapper, loop closer: 0,1,1");
  command.add_flag("--rt", arguments.real_time, "Tracker under SCHED_FIFO, memory locked, where permitted");
  command.add_flag("--quiet", arguments.quiet, "No progress line");
}

}  // namespace twofold
