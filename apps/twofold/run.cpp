#include <csignal>

#include <unistd.h>
#include <CLI/CLI.hpp>
#include <atomic>
#include <fstream>
#include <memory>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/map_options.hpp"
#include "apps/twofold/map_parts.hpp"
#include "apps/twofold/run_filter.hpp"
#include "apps/twofold/run_output.hpp"
#include "engine/engine.hpp"
#include "engine/worker.hpp"
#include "io/io_error.hpp"
#include "io/open_source.hpp"
#include "io/output_file.hpp"
#include "io/recorded_source.hpp"
#include "loopclosure/default_vocabulary.hpp"

namespace twofold {
namespace {

struct RunArguments {
  std::string source;
  std::string calibration;
  std::string out = "out/run";
  std::string speed = "max";
  std::string late = "queue";
  std::string windows = "25,175";
  std::string replay_schedule;
  std::string trace;
  std::string pin;
  std::string vocabulary;
  std::string record;
  std::string estimator = "engine";
  int window = 10;
  MapArguments map;
  bool no_metric_loops = false;
  bool no_places = false;
  bool deterministic = false;
  bool preload = false;
  bool real_time = false;
  bool quiet = false;
};

// A signal handler may touch a lock-free atomic; relaxed, because it carries no other data.
std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free);
void on_interrupt(int) {
  interrupted.store(true, std::memory_order_relaxed);
}

std::vector<int> parse_numbers(const std::string& text, std::size_t count, const char* option) {
  std::vector<int> numbers;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    std::size_t used = 0;
    int number = -1;
    try {
      number = std::stoi(part, &used);
    } catch (const std::exception&) {
      used = part.size() + 1;
    }
    if (used != part.size() || part.empty()) throw IoError(option, fmt::format("'{}' is not a number", part));
    numbers.push_back(number);
    begin = end + 1;
  }
  if (numbers.size() != count) throw IoError(option, fmt::format("needs {} numbers, got '{}'", count, text));
  return numbers;
}

EngineOptions engine_options(const RunArguments& arguments) {
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
  options.pacing.late = arguments.late == "drop" ? LatePolicy::kDrop : LatePolicy::kQueue;
  const std::vector<int> windows = parse_numbers(arguments.windows, 2, "--windows");
  options.mapper.inner_window = windows[0];
  options.mapper.outer_window = windows[1];
  if (const std::string reason = options.mapper.invalid_reason(); !reason.empty())
    throw IoError("--windows", reason);
  if (!arguments.pin.empty()) {
    const std::vector<int> cpus = parse_numbers(arguments.pin, 3, "--pin");
    options.tracker_cpu = cpus[0];
    options.mapper_cpu = cpus[1];
    options.loop_closer_cpu = cpus[2];
  }
  if (arguments.real_time) options.fifo_priority = 50;
  options.mapper.loop.enabled = !arguments.no_metric_loops;
  if (!arguments.no_places) {
    options.vocabulary = std::make_shared<const Vocabulary>(
        arguments.vocabulary.empty() ? load_default_vocabulary() : Vocabulary::load(arguments.vocabulary));
  }
  return options;
}

/// Redrawn in place, a few times a second; nothing when standard error is not a terminal.
class ProgressLine {
 public:
  ProgressLine(std::optional<std::int64_t> total, bool quiet)
      : total_(total), visible_(!quiet && isatty(STDERR_FILENO) == 1), start_ns_(steady_now_ns()) {}

  void show(const Progress& p) {
    const std::int64_t now_ns = steady_now_ns();
    if (!visible_ || now_ns - shown_ns_ < 200'000'000) return;
    shown_ns_ = now_ns;
    const double fps = static_cast<double>(p.frames) / (static_cast<double>(now_ns - start_ns_) * 1e-9);
    const std::string total = total_ ? fmt::format("/{}", *total_) : "";
    fmt::print(
        stderr,
        "\rframe {}{}  {:.0f} fps  tracked {:.0f} %  keyframes {}  map version {}  queue {}  lost {}  ",
        p.frames, total, fps, 100 * p.tracked_share, p.keyframes, p.map_version, p.queued, p.lost);
    std::fflush(stderr);
  }
  void end() const {
    if (visible_) fmt::print(stderr, "\n");
  }

 private:
  std::optional<std::int64_t> total_;
  bool visible_;
  std::int64_t start_ns_;
  std::int64_t shown_ns_ = 0;
};

/// Locks memory where --rt asks for it; what was asked for and is not to be had. Threads report their own.
std::vector<std::string> real_time_notes(const RunArguments& arguments) {
  const bool one_thread = arguments.deterministic || !arguments.replay_schedule.empty();
  if (one_thread && (arguments.real_time || !arguments.pin.empty()))
    return {"--pin and --rt have no effect: this run has one thread"};
  if (!arguments.real_time) return {};
  if (const auto locked = lock_memory(); !locked) return {locked.error()};
  return {};
}

Schedule load_schedule(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw IoError(file, "cannot be opened");
  auto schedule = read_schedule(in);
  if (!schedule) throw IoError(file, schedule.error());
  return *std::move(schedule);
}

SourceOptions source_options_of(const RunArguments& arguments) {
  SourceOptions options;
  options.preload = arguments.preload;
  options.stop = &interrupted;
  if (!arguments.calibration.empty()) options.calibration = arguments.calibration;
  return options;
}

int run_with_filter(const RunArguments& arguments) {
  prepare_output_folder(arguments.out);
  const auto source = open_source(arguments.source, source_options_of(arguments));
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  run_filter(*source, arguments.source, arguments.window, arguments.out, interrupted);
  return kOk;
}

int run(const RunArguments& arguments) {
  if (arguments.estimator == "swf") return run_with_filter(arguments);
  EngineOptions options = engine_options(arguments);
  apply_map_options(arguments.map, options);
  std::optional<Schedule> schedule;
  if (!arguments.replay_schedule.empty()) schedule = load_schedule(arguments.replay_schedule);
  prepare_output_folder(arguments.out);
  std::unique_ptr<FrameSource> source = open_source(arguments.source, source_options_of(arguments));
  // A camera's frames are due when they are taken, whether anybody asks for a pace or not.
  if (source->is_live() && options.pacing.speed == 0) options.pacing.speed = 1;
  if (source->rig().kind == SensorKind::kMono) {
    throw IoError(arguments.source, "has a single camera without depth; stereo or RGB-D is needed");
  }
  expect_rig_of_map(arguments.map, arguments.source, source->rig(), options);
  if (!arguments.record.empty()) {
    source = std::make_unique<RecordedSource>(std::move(source), arguments.record);
  }

  ProgressLine line(source->frame_count(), arguments.quiet);
  const FrameFeed feed = [&](Frame& frame) {
    switch (source->next(frame)) {
      case FrameStatus::kFrame:
        return FeedStatus::kFrame;
      case FrameStatus::kEnd:
        return FeedStatus::kEnd;
      case FrameStatus::kError:
        break;
    }
    return FeedStatus::kError;
  };
  const ProgressSink progress = [&](const Progress& p) { line.show(p); };
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  const std::vector<std::string> notes = real_time_notes(arguments);
  Engine engine(source->rig(), options);
  RunResult result = schedule ? engine.replay(feed, *schedule, interrupted, progress)
                              : engine.run(feed, interrupted, progress);
  line.end();
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  std::vector<std::string> maps;
  if (!arguments.map.save.empty()) {
    maps = save_parts(arguments.map.save, source->rig(), result, map_parts(result, options));
  }
  write_run_output(arguments.out, arguments.source, *source, options, result);
  if (!arguments.trace.empty()) write_trace(arguments.trace, result);
  print_summary(arguments.out, options, result);
  for (const std::string& map : maps) fmt::print("map in      {}\n", map);
  const SourceReport captured = source->report();
  for (const std::string& text : captured.summary) fmt::print("{}\n", text);
  for (const std::string& text : captured.faults) fmt::print("  {}\n", text);
  if (!source->error().empty()) throw IoError("", source->error());
  if (!result.error.empty()) throw std::runtime_error(result.error);
  const bool any_tracked =
      std::any_of(result.frames.begin(), result.frames.end(),
                  [](const FrameRecord& record) { return record.state == FrameState::kTracked; });
  if (!any_tracked && options.map)
    throw std::runtime_error(arguments.source + ": no place of the loaded map was recognised");
  if (!any_tracked) throw std::runtime_error(arguments.source + ": no frame could be tracked");
  return kOk;
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Track and map a recording, a rendered scene or a camera");
  command
      ->add_option("SOURCE", arguments->source,
                   "Path, or scheme:ARGUMENT?key=value (kitti, euroc, tum, images, "
                   "video, synthetic)")
      ->required();
  command->add_option("--calib", arguments->calibration, "Calibration file instead of the recording's own");
  command->add_option("--out", arguments->out, "Folder for trajectories, map, timing")->capture_default_str();
  command->add_option("--speed", arguments->speed, "Recorded seconds a second (1, 2, ...), or max")
      ->capture_default_str();
  command->add_option("--late", arguments->late, "Frames that are late: queue or drop")
      ->check(CLI::IsMember({"queue", "drop"}))
      ->capture_default_str();
  command->add_option("--windows", arguments->windows, "Keyframes in the inner and outer window")
      ->capture_default_str();
  command
      ->add_option("--estimator", arguments->estimator,
                   "engine, or swf: the sliding window filter on stereo, for surface structure")
      ->check(CLI::IsMember({"engine", "swf"}))
      ->capture_default_str();
  command->add_option("--window", arguments->window, "Poses the sliding window filter keeps (0: all)")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_option("--vocabulary", arguments->vocabulary, "Vocabulary file instead of the built-in one");
  command->add_option("--record", arguments->record,
                      "Record the frames into this folder: the run can be repeated from it and schedule.log");
  add_map_options(*command, arguments->map);
  command->add_flag("--no-places", arguments->no_places, "Recognise no places: no large loops are closed");
  command->add_flag("--no-metric-loops", arguments->no_metric_loops,
                    "Close no small loops: for experiments with drift");
  command->add_flag("--deterministic", arguments->deterministic,
                    "One thread, one order: same input, same bytes");
  command->add_option("--replay-schedule", arguments->replay_schedule,
                      "Repeat the run that wrote this schedule.log");
  command->add_flag("--preload", arguments->preload, "Decode everything into memory before the clock starts");
  command->add_option("--trace", arguments->trace,
                      "Write spans and counters for ui.perfetto.dev to this file");
  command->add_option("--pin", arguments->pin, "CPUs of tracker, mapper, loop closer: 0,1,1");
  command->add_flag("--rt", arguments->real_time, "Tracker under SCHED_FIFO, memory locked, where permitted");
  command->add_flag("--quiet", arguments->quiet, "No progress line");
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace twofold
