#include "apps/command_line.hpp"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "graph/map_file.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
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
int report(const CLI::App& app, const std::string& what, int exit_code) {
  const std::string line = fmt::format("{}: {}\n", app.get_name(), what.substr(0, what.find('\n')));
  (void)std::fputs(line.c_str(), stderr);  // which throws nothing when standard error is full
  return exit_code;
}

/// A message about subcommands says which word is none, and where they are listed.
std::string usage_text(const CLI::App& app, const CLI::ParseError& error) {
  std::string asked = app.get_name();
  const CLI::App* command = &app;
  for (auto inner = app.get_subcommands(); !inner.empty(); inner = command->get_subcommands()) {
    command = inner.front();
    asked += " " + command->get_name();
  }
  std::string what = error.what();
  if (what != "A subcommand is required") return what;
  const std::vector<std::string> words = command->remaining();
  return (words.empty() ? what : "'" + words.front() + "' is no subcommand") + "; " + asked +
         " --help lists them";
}

/// `rule` in words after "must be".
CLI::Validator number_check(bool (*holds)(double), const std::string& rule, const std::string& description) {
  const auto check = [=](const std::string& text) {
    char* end = nullptr;
    const double number = std::strtod(text.c_str(), &end);
    const bool whole = !text.empty() && *end == '\0' && std::isfinite(number);
    return whole && holds(number) ? "" : fmt::format("must be {}, is {}", rule, text);
  };
  return {check, description};
}

}  // namespace

CLI::Validator at_least_zero() {
  return number_check([](double number) { return number >= 0; }, "a number >= 0", "NONNEGATIVE");
}

CLI::Validator above_zero() {
  return number_check([](double number) { return number > 0; }, "a number > 0", "POSITIVE");
}

int run_command_line(CLI::App& app, int argc, char** argv, const int& exit_code) {
  silence_decoders();
  forbid_hidden_threads();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help
    return report(app, usage_text(app, e), kBadInput);
  } catch (const WriteError& e) {
    return report(app, e.what(), kFailedRun);
  } catch (const IoError& e) {
    return report(app, e.what(), kBadInput);
  } catch (const MapFileError& e) {
    return report(app, e.what(), kBadInput);
  } catch (const std::filesystem::filesystem_error& e) {
    return report(app, e.path1().string() + ": " + e.code().message(), kBadInput);
  } catch (const std::exception& e) {
    return report(app, e.what(), kFailedRun);
  }
  return exit_code;
}

}  // namespace twofold
