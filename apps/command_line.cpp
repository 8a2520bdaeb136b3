#include "apps/command_line.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numeric>
#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <string>
#include <utility>
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

/// How many letters must be changed, added or left out to make one word of the other; Levenshtein 1966.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);  // from what was read of a to each beginning of b
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t changed = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({changed, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The option of the command whose name is most like `word`, with its dashes; empty: none is.
std::string option_like(const CLI::App& command, const std::string& word) {
  constexpr std::size_t kAlike = 2;
  std::string best;
  std::size_t fewest = kAlike + 1;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      const std::size_t edits = edit_distance("--" + name, word);
      if (edits < std::min(fewest, name.size())) {
        fewest = edits;
        best = "--" + name;
      }
    }
  }
  return best;
}

/// Of words that no option or argument has taken: the first option, after which a value may be left over,
/// too.
std::string unexpected_text(const CLI::App& command, const std::string& asked) {
  const std::vector<std::string> words = command.remaining();
  const auto option =
      std::find_if(words.begin(), words.end(), [](const std::string& word) { return word.starts_with('-'); });
  if (option == words.end())
    return fmt::format("'{}' was not expected; {} --help says what is", words.front(), asked);
  const std::string name = option->substr(0, option->find('='));
  const std::string like = option_like(command, name);
  return fmt::format("'{}' is no option of {}{}; --help lists them", name, asked,
                     like.empty() ? "" : " (" + like + "?)");
}

/// A message about subcommands says which word is none, and where they are listed.
std::string usage_text(const CLI::App& app, const CLI::ParseError& error) {
  std::string asked = app.get_name();
  const CLI::App* command = &app;
  for (auto inner = app.get_subcommands(); !inner.empty(); inner = command->get_subcommands()) {
    command = inner.front();
    asked += " " + command->get_name();
  }
  const std::vector<std::string> words = command->remaining();
  const bool unexpected = dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr;
  if (unexpected && !words.empty()) return unexpected_text(*command, asked);
  std::string what = error.what();
  if (what != "A subcommand is required") return what;
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
