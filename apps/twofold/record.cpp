#include <unistd.h>

#include <CLI/CLI.hpp>
#include <memory>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "apps/twofold/interrupt.hpp"
#include "apps/twofold/output/output_folder.hpp"
#include "apps/twofold/record_session.hpp"
#include "engine/clock.hpp"
#include "io/files/calibration_file.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/recorder.hpp"

namespace twofold {
namespace {

struct RecordArguments {
  std::string source;
  std::string out;
  std::string calibration;
  std::int64_t frames = 0;
  std::size_t queue = 64;
  bool quiet = false;
};

void show(const Recorder::Counts& counts, const SourceReport& source, bool last) {
  fmt::print(stderr,
             "\r{} frames written  {} waiting  {} lost by the camera  {} lost by writing  {:.1f} MB  {}",
             counts.written, counts.queued, source.lost, counts.refused,
             static_cast<double>(counts.bytes) * 1e-6, last ? "\n" : "");
  std::fflush(stderr);
}

std::optional<Calibration> calibration_for(const FrameSource& source, const RecordArguments& arguments) {
  if (!source.is_raw()) return calibration_of(source.rig());
  if (arguments.calibration.empty()) return std::nullopt;
  Calibration calibration = read_calibration(arguments.calibration);
  expect_valid(arguments.calibration, calibration);
  return calibration;
}

int record(const RecordArguments& arguments) {
  SourceOptions options;
  options.raw = true;
  options.stop = &interrupted();
  if (!arguments.calibration.empty()) options.calibration = arguments.calibration;
  expect_not_of_source(arguments.out, arguments.source, "OUT");
  catch_interrupts();
  const std::unique_ptr<FrameSource> source = open_source(arguments.source, options);
  RecorderOptions recorder_options;
  recorder_options.queue_frames = arguments.queue;
  Recorder recorder(arguments.out, source->rig().kind, calibration_for(*source, arguments), recorder_options);

  const bool visible = !arguments.quiet && isatty(STDERR_FILENO) == 1;
  std::int64_t shown_ns = 0;
  const auto tick = [&] {
    if (!visible || steady_now_ns() - shown_ns < 200'000'000) return;
    shown_ns = steady_now_ns();
    show(recorder.counts(), source->report(), false);
  };
  const RecordOutcome outcome = record_from(*source, recorder, arguments.frames, interrupted(), tick);
  if (visible) show(outcome.counts, outcome.report, true);
  fmt::print("{}: {}", arguments.out, describe(outcome));
  if (!outcome.problem.empty()) throw std::runtime_error(outcome.problem);
  return outcome.all_written() ? kOk : kFailedRun;
}

}  // namespace

void add_record_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<RecordArguments>();
  CLI::App* command = app.add_subcommand("record", "Write a camera's frames into a folder of EuRoC layout");
  command
      ->add_option("SOURCE", arguments->source, "v4l2:/dev/video0?size=640x480&fps=30, or any other source")
      ->required();
  command->add_option("OUT", arguments->out, "Folder of the recording; must not hold one yet")->required();
  command->add_option("--calib", arguments->calibration, "Calibration to store with a camera's recording");
  command->add_option("--frames", arguments->frames, "Stop after so many (0: at Ctrl-C or the end)")
      ->check(at_least_zero());
  command->add_option("--queue", arguments->queue, "Frames that may wait to be written")
      ->check(above_zero())
      ->capture_default_str();
  command->add_flag("--quiet", arguments->quiet, "No counter");
  command->callback([arguments, &exit_code] { exit_code = record(*arguments); });
}

}  // namespace twofold
