#include <CLI/CLI.hpp>
#include <memory>

#include <fmt/format.h>

#include "apps/twofold/calibration/calibration_session.hpp"
#include "apps/twofold/commands.hpp"
#include "apps/twofold/interrupt.hpp"
#include "calibration/board.hpp"
#include "io/files/io_error.hpp"
#include "io/files/output_file.hpp"
#include "io/sources/layouts/recognise_layout.hpp"
#include "io/sources/open_source.hpp"
#include "io/sources/raw_folder_source.hpp"
#include "io/sources/source_parameters.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

struct CalibrateArguments {
  std::string source, out, board, residuals;
  int views = 20;
  bool quiet = false;
};

bool is_video(const SourceSpec& spec) {
  std::error_code error;
  return spec.scheme == "video" || (spec.scheme.empty() && fs::is_regular_file(spec.argument, error) &&
                                    recognise_layout(spec.argument) == "video");
}

/// Its images as the camera took them.
std::unique_ptr<FrameSource> open_raw(const SourceSpec& spec) {
  SourceOptions options;
  options.raw = options.suppose_camera = true;
  options.stop = &interrupted();
  if (spec.is_camera() || is_video(spec)) return open_source(spec.text, options);
  if (!spec.scheme.empty() && spec.scheme != "images" && spec.scheme != "euroc")
    throw IoError(spec.text, "calibrate reads cameras (v4l2:), videos, and folders of images");
  return std::make_unique<RawFolderSource>(spec.argument);
}

int calibrate(const CalibrateArguments& arguments) {
  if (const auto board = parse_board(arguments.board); !board) throw IoError("--board", board.error());
  const SourceSpec spec = parse_source_spec(arguments.source);
  CalibrationRequest request{arguments.board, arguments.views, arguments.out, arguments.residuals,
                             spec.is_camera() || is_video(spec)};
  if (request.plot.empty()) request.plot = fs::path(arguments.out).replace_extension(".png");
  if (request.plot.lexically_normal() == request.out.lexically_normal())
    throw IoError("--out", arguments.out + " is where the picture of the residuals goes: name it .yaml");
  if (request.out.has_parent_path()) prepare_output_folder(request.out.parent_path());
  catch_interrupts();
  const auto source = open_raw(spec);
  for (const std::string& note : source->report().notes) fmt::print("note        {}\n", note);
  const auto say = [&](const std::string& line) {
    if (!arguments.quiet) fmt::print(stderr, "{}\n", line);
  };
  fmt::print("{}", calibrate_from(*source, request, interrupted(), say));
  return kOk;
}

}  // namespace

void add_calibrate_command(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<CalibrateArguments>();
  CLI::App* command =
      app.add_subcommand("calibrate", "Calibrate a camera or a stereo pair with a printed board");
  command
      ->add_option("SOURCE", arguments->source,
                   "v4l2:..., a video (FILE?layout=side-by-side: of a pair), a folder of images, one with "
                   "left/ and right/, or a recording")
      ->required();
  command->add_option("-o,--out", arguments->out, "Calibration file to write")->required();
  command
      ->add_option("--board", arguments->board,
                   "chessboard:9x6:0.025 (inner corners, side of a square [m]) or charuco:8x6:0.03:0.022")
      ->required();
  command->add_option("--views", arguments->views, "Different views wanted from a camera")
      ->check(CLI::Range(10, 200))
      ->capture_default_str();
  command->add_option("--residuals", arguments->residuals,
                      "Picture of the residuals (default: cal.png for cal.yaml)");
  command->add_flag("--quiet", arguments->quiet, "Do not say which view is missing");
  command->callback([arguments, &exit_code] { exit_code = calibrate(*arguments); });
}

}  // namespace twofold
