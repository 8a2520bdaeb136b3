#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/command_line.hpp"

namespace twofold {

/// All that went wrong in a run, told at its end together: what one file lost is not left unsaid because
/// another one failed first.
class RunFailures {
 public:
  /// @param code  kBadInput for what the user gave, kFailedRun for what happened on the way
  void add(std::string what, ExitCode code = kFailedRun);
  /// Calls it, and keeps the exception that it throws: an IoError that is no WriteError is of the input.
  void attempt(const std::function<void()>& step);

  [[nodiscard]] const std::vector<std::string>& all() const { return all_; }
  [[nodiscard]] std::string text() const;  ///< joined by "; "

  /// Throws IoError when something is of the input, else std::runtime_error; with text(). Nothing failed:
  /// nothing is thrown.
  void expect_none() const;

 private:
  std::vector<std::string> all_;
  ExitCode code_ = kOk;
};

}  // namespace twofold
