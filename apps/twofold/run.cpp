#include <unistd.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/twofold/calibration/auto_calibration.hpp"
#include "apps/twofold/commands.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/live_view.hpp"
#include "apps/twofold/map_parts.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/pose_streaming.hpp"
#include "apps/twofold/run_arguments.hpp"
#include "apps/twofold/run_failures.hpp"
#include "apps/twofold/run_filter.hpp"
#include "apps/twofold/run_output.hpp"
#include "apps/twofold/surface/live_surface.hpp"
#include "engine/engine.hpp"
#include "engine/logs/input_fingerprint.hpp"
#include "engine/worker.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recording_tee.hpp"

namespace twofold {
namespace {

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
        p.frames, total, fps, 100 * p.tracked_share, p.keyframes, p.map_version, p.waiting.keyframes, p.lost);
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

/// That of the run to be repeated; none: it is not asked for.
std::optional<Schedule> schedule_of(const RunArguments& arguments) {
  const std::string& file = arguments.replay_schedule;
  if (file.empty()) return std::nullopt;
  std::error_code ignored;
  if (std::filesystem::equivalent(file, std::filesystem::path(arguments.out) / "schedule.log", ignored))
    throw IoError(file, "is in the folder that the replay would write to: name another one for --out");
  auto schedule = load_schedule(file);
  if (!schedule) throw IoError(file, schedule.error());
  return *std::move(schedule);
}

bool calibrates_itself(const RunArguments& arguments) {
  return arguments.calibration == "auto";
}

/// Empty: the source's own calibration holds, or none is known beforehand.
std::string calibration_file_of(const RunArguments& arguments) {
  return calibrates_itself(arguments) ? std::string() : arguments.calibration;
}

SourceOptions source_options_of(const RunArguments& arguments) {
  SourceOptions options;
  options.preload = arguments.preload;
  options.left_only = arguments.camera == "mono";
  options.stop = &interrupted();
  if (const std::string file = calibration_file_of(arguments); !file.empty()) options.calibration = file;
  return options;
}

/// Reads the first frame of a recording: what it cannot deliver is known while an earlier run's files are
/// still there. A camera's frame is not read before it is wanted. Throws IoError.
const Frame* first_frame_of(FrameSource& source) {
  return source.is_live() ? nullptr : source.peek();
}

int run_with_filter(const RunArguments& arguments) {
  expect_options_of_filter(arguments);
  expect_output_folder(arguments.out, arguments.source);
  prepare_output_folder(arguments.out);
  const auto source = open_source(arguments.source, source_options_of(arguments));
  expect_stereo(source->rig(), arguments.source);
  (void)first_frame_of(*source);
  remove_earlier_run(arguments.out, calibration_file_of(arguments));
  catch_interrupts();
  run_filter(*source, arguments.source, arguments.window, arguments.out, interrupted());
  return kOk;
}

std::unique_ptr<FrameSource> open_frames(const RunArguments& arguments,
                                         std::optional<AutoCalibration>& calibration) {
  const SourceOptions options = source_options_of(arguments);
  if (!calibrates_itself(arguments)) return open_source(arguments.source, options);
  catch_interrupts();  // a camera may be watched for long
  return open_with_auto_calibration(arguments.source, options, arguments.out, calibration.emplace());
}

/// Known with the source alone: a camera keeps a pace of its own.
void expect_pace_for_late(const RunArguments& arguments, const EngineOptions& options) {
  const bool repeats = !arguments.replay_schedule.empty();  // whose frames were late is in the schedule
  if (arguments.late.empty() || options.pacing.keeps_pace() || repeats) return;
  throw IoError("--late", "needs a pace, of --speed or of a camera: without one no frame is late");
}

struct PreparedSource {
  std::unique_ptr<FrameSource> source;
  RecordingTee* recorder = nullptr;  ///< the source itself, with --record
};

/// The source as the run takes it, known to fit, and what `options` need to say of it.
PreparedSource prepared(std::unique_ptr<FrameSource> source, const RunArguments& arguments,
                        EngineOptions& options) {
  if (source->is_live()) {
    options.pacing.live = true;
    if (arguments.late.empty()) options.pacing.late = LatePolicy::kNewest;
  }
  source = resampled_for_map(std::move(source), options);
  expect_rig_of_map(arguments.map, arguments.source, source->rig(), options);
  expect_pace_for_late(arguments, options);
  if (arguments.record.empty()) return {std::move(source)};
  auto recording = std::make_unique<RecordingTee>(std::move(source), arguments.record);
  RecordingTee* const recorder = recording.get();
  return {std::move(recording), recorder};
}

/// Refuses (IoError) a schedule of another rig or recording.
void expect_input_of_schedule(const Schedule& schedule, const std::string& file, const Rig& rig,
                              const Frame* first) {
  if (first == nullptr || !schedule.input) return;
  const std::string why = mismatch(*schedule.input, fingerprint_of(rig, *first));
  if (!why.empty()) throw IoError(file, why);
}

/// Of keyframes that a viewer clicks.
RecordedImages images_to_look_at(const RunArguments& arguments) {
  if (!arguments.view.port) return {};
  if (!arguments.record.empty()) return images_being_recorded(arguments.record);
  return images_of_recording(arguments.source, source_options_of(arguments).calibration);
}

FrameFeed feed_from(FrameSource& source, LiveView& view, LiveSurface& surface) {
  return [&](Frame& frame) {
    const FrameStatus status = source.next(frame);
    if (status == FrameStatus::kFrame) {
      view.show(frame);
      surface.show(frame);
    }
    return status;
  };
}

/// The surface's mesh while it arises; nothing without a viewer.
LiveMesh::Listener mesh_listener(LiveView& view, double voxel) {
  if (!view.wanted()) return {};
  return [&view, voxel](const MeshPieces& mesh, KeyframeId part) { view.show(mesh, part, voxel); };
}

RunResult run_engine(const RunArguments& arguments, const EngineOptions& options,
                     std::optional<Schedule> schedule, FrameSource& source, LiveView& view,
                     LiveSurface& surface) {
  ProgressLine line(source.frame_count(), arguments.quiet);
  const FrameFeed feed = feed_from(source, view, surface);
  const ProgressSink progress = [&](const Progress& p) {
    line.show(p);
    view.show(p);
  };
  catch_interrupts();
  const std::vector<std::string> notes = real_time_notes(arguments);
  Engine engine(source.rig(), options);
  RunResult result = schedule ? engine.replay(feed, *std::move(schedule), interrupted(), progress)
                              : engine.run(feed, interrupted(), progress);
  line.end();
  result.notes.insert(result.notes.begin(), notes.begin(), notes.end());
  const std::vector<std::string> of_source = source.report().notes;
  result.notes.insert(result.notes.begin(), of_source.begin(), of_source.end());
  return result;
}

SurfaceFigures write_live_surface(const RunArguments& arguments, LiveSurface& surface,
                                  const GraphSnapshot& graph, KeyframeId part) {
  SurfaceFigures figures;
  const TriangleMesh mesh = surface.finish(graph, part, figures);
  write_surface(arguments.out, mesh, -Vector3::UnitY(), arguments.surface.files);
  return figures;
}

/// ": " and why most frames were lost; empty: none was.
std::string main_cause(const RunResult& result) {
  std::map<std::string, std::size_t> causes;
  for (const FrameRecord& record : result.frames)
    if (record.state == FrameState::kLost) ++causes[describe(record.cause)];
  const auto most = std::max_element(causes.begin(), causes.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == causes.end() ? "" : ": " + most->first;
}

/// Why no frame has a pose in a loaded map.
std::string nothing_localised(const RunResult& result) {
  if (result.recognised == 0) return "no place of the loaded map was recognised";
  return fmt::format(
      "a place of the loaded map was recognised {}, but from none of them the camera could be followed{}",
      result.recognised == 1 ? "once" : fmt::format("{} times", result.recognised), main_cause(result));
}

/// What the run failed of: the source, a thread, that nothing was tracked; and what its files lost.
RunFailures failures_of(const std::string& name, const PreparedSource& frames, const EngineOptions& options,
                        const RunResult& result, const PoseStreaming& poses) {
  const FrameSource& source = *frames.source;
  RunFailures failures;
  if (!source.error().empty()) {
    failures.add(source.error(), source.is_live() ? kFailedRun : kBadInput);
  } else if (!result.error.empty()) {
    failures.add(result.error);
  } else if (result.counts.tracked == 0 && !result.interrupted) {
    failures.add(
        name + ": " +
        (options.map ? nothing_localised(result) : "no frame could be tracked" + main_cause(result)));
  }
  for (const std::string& loss : result.losses) failures.add(loss);
  for (const std::string& problem : poses.problems()) failures.add("--poses " + problem);
  if (frames.recorder != nullptr) {
    if (const std::string loss = frames.recorder->finish(); !loss.empty()) failures.add("--record " + loss);
  }
  return failures;
}

RunFrames frames_of(const RunArguments& arguments, const std::optional<AutoCalibration>& calibration,
                    const RunFailures& failures) {
  return {arguments.source, arguments.record, calibration_file_of(arguments),
          calibration ? auto_calibration_json(*calibration) : nullptr, failures.all()};
}

/// The summary, and what stands below it.
void print_results(const RunArguments& arguments, const EngineOptions& options, const FrameSource& source,
                   const RunResult& result, const std::vector<MapPart>& parts,
                   const std::vector<std::string>& maps, const std::optional<SurfaceFigures>& surface) {
  print_summary(arguments.out, source.rig(), options, result, parts);
  if (surface) print_surface(*surface);
  if (scale_is_arbitrary(source.rig(), options))
    fmt::print("scale       arbitrary: one camera does not show it (eval --align sim3)\n");
  for (const std::string& map : maps) fmt::print("map in      {}\n", map);
  print_source_report(source.report());
}

/// What is left of a run that is over: files and figures. What cannot be written stops nothing else, and is
/// told at the end.
void write_results(const RunArguments& arguments, const EngineOptions& options, const PreparedSource& frames,
                   const std::optional<AutoCalibration>& calibration, RunResult& result,
                   const PoseStreaming& poses, LiveSurface& surface) {
  const FrameSource& source = *frames.source;
  const std::vector<MapPart> parts = map_parts(result, options);
  RunFailures failures = failures_of(arguments.source, frames, options, result, poses);
  std::vector<std::string> maps;
  if (!arguments.map.save.empty())
    failures.attempt([&] { maps = save_parts(arguments.map.save, source.rig(), result, parts); });
  std::optional<SurfaceFigures> figures;
  if (surface.wanted())
    failures.attempt(
        [&] { figures = write_live_surface(arguments, surface, result.graph, parts.front().id); });
  // Of a run that tracked nothing, or was interrupted, a surface is not expected.
  if (figures && figures->triangles == 0 && result.counts.tracked > 0 && !result.interrupted)
    failures.add(arguments.source + ": --surface: " + no_mesh_reason(*figures, SurfaceOptions().max_depth));
  update_peak_memory(result);
  failures.attempt([&] {
    write_run_output(arguments.out, frames_of(arguments, calibration, failures), source, options, result,
                     parts, figures ? surface_json(*figures) : nullptr);
  });
  if (!arguments.trace.empty()) failures.attempt([&] { write_trace(arguments.trace, result); });
  print_results(arguments, options, source, result, parts, maps, figures);
  failures.expect_none();
}

int run(const RunArguments& arguments) {
  if (arguments.estimator == "swf") return run_with_filter(arguments);
  EngineOptions options = engine_options(arguments);
  apply_map_options(arguments.map, options);
  options.logs.folder = arguments.out;
  std::optional<Schedule> schedule = schedule_of(arguments);
  expect_place_for_file(arguments.trace, "--trace");
  expect_output_folder(arguments.out, arguments.source);
  expect_not_of_source(arguments.record, arguments.source, "--record");
  if (calibrates_itself(arguments)) expect_place_for_calibration(arguments.out);
  prepare_output_folder(arguments.out);
  std::optional<AutoCalibration> calibration;
  auto opened = open_frames(arguments, calibration);
  const std::filesystem::path calibrated_by =
      calibration ? calibration->file : std::filesystem::path(calibration_file_of(arguments));
  const PreparedSource frames = prepared(std::move(opened), arguments, options);
  const auto& source = frames.source;
  const Frame* const first = first_frame_of(*source);
  if (schedule) expect_input_of_schedule(*schedule, arguments.replay_schedule, source->rig(), first);

  PoseStreaming poses(arguments.poses, arguments.poses_form);
  poses.listen(options);
  if (calibration) print_auto_calibration(*calibration);  // now that standard output is for people, or moved
  LiveView view(arguments.view, arguments.source, arguments.out, *source, images_to_look_at(arguments),
                options);
  const bool one_thread = options.deterministic || schedule.has_value();
  LiveSurface surface(arguments.surface, *source, options, one_thread,
                      mesh_listener(view, arguments.surface.voxel));
  remove_earlier_run(arguments.out, calibrated_by);  // nothing refuses this one any more
  RunResult result = run_engine(arguments, options, std::move(schedule), *source, view, surface);
  poses.finish();
  view.finish();

  write_results(arguments, options, frames, calibration, result, poses, surface);
  return kOk;
}

}  // namespace

void add_run_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Track and map a recording, a rendered scene or a camera");
  add_run_options(*command, *arguments);
  command->callback([arguments, &exit_code] { exit_code = run(*arguments); });
}

}  // namespace twofold
