#include <CLI/CLI.hpp>
#include <cstdlib>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>

#include <fmt/format.h>

#include "apps/twofold/commands.hpp"
#include "graph/map_file.hpp"
#include "io/files/io_error.hpp"

namespace {

/// Errors are reported once, by us: the image and video decoders stay quiet.
void silence_decoders() {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0);  // AV_LOG_QUIET
}

/// Rectification and descriptors call OpenCV from the reader's and the loop closer's threads. Threads of its
/// own beside them would be scheduled on the tracker's core.
void forbid_hidden_threads() {
  cv::setNumThreads(1);
}

/// One line, whatever the library put into its message.
int report(const std::string& what, int exit_code) {
  fmt::print(stderr, "twofold: {}\n", what.substr(0, what.find('\n')));
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  silence_decoders();
  forbid_hidden_threads();
  CLI::App app{"Twofold: real-time visual SLAM", "twofold"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "twofold " TWOFOLD_VERSION);
  int exit_code = twofold::kOk;
  twofold::add_run_command(app, exit_code);
  twofold::add_eval_command(app, exit_code);
  twofold::add_timing_command(app, exit_code);
  twofold::add_calibrate_command(app, exit_code);
  twofold::add_doctor_command(app, exit_code);
  twofold::add_record_command(app, exit_code);
  twofold::add_devices_command(app, exit_code);
  twofold::add_render_command(app, exit_code);
  twofold::add_map_command(app, exit_code);
  twofold::add_vocabulary_command(app, exit_code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help
    const std::string hint = argc == 1 ? "; twofold --help lists them" : "";
    return report(e.what() + hint, twofold::kBadInput);
  } catch (const twofold::IoError& e) {
    return report(e.what(), twofold::kBadInput);
  } catch (const twofold::MapFileError& e) {
    return report(e.what(), twofold::kBadInput);
  } catch (const std::exception& e) {
    return report(e.what(), twofold::kFailedRun);
  }
  return exit_code;
}
