#pragma once

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <string>

namespace twofold {

/// What a program ends with.
enum ExitCode : int { kOk = 0, kFailedRun = 1, kBadInput = 2 };

/// For options that name a file: an empty name, as an unset variable of a shell script leaves it, is not the
/// same as no option.
inline std::string empty_name(const std::string& text) {
  return text.empty() ? "is empty" : "";
}

/// For options that are numbers. CLI11's own NonNegativeNumber and PositiveNumber name the range up to the
/// largest double, in all its 309 digits.
[[nodiscard]] CLI::Validator at_least_zero();
[[nodiscard]] CLI::Validator above_zero();

/// Parses the command line, which runs the subcommand that it names. An error becomes one line on the
/// standard error output, after the program's name: kBadInput for a bad command line, an IoError or a
/// MapFileError, kFailedRun for a WriteError and any other exception.
/// @param exit_code  written by the subcommand
/// @return  what the program ends with
[[nodiscard]] int run_command_line(CLI::App& app, int argc, char** argv, const int& exit_code);

}  // namespace twofold
