#include "apps/twofold/pose_streaming.hpp"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

#include "engine/listeners.hpp"
#include "io/files/io_error.hpp"

namespace twofold {
namespace {

/// Two writers of one file would write over each other.
void expect_no_target_twice(const std::vector<std::string>& targets) {
  std::set<std::filesystem::path> seen;
  for (const std::string& target : targets) {
    std::error_code ignored;
    if (!seen.insert(std::filesystem::weakly_canonical(std::filesystem::absolute(target, ignored), ignored))
             .second)
      throw IoError("--poses", target + ": is given twice");
  }
}

}  // namespace

PoseStreaming::PoseStreaming(const std::vector<std::string>& targets, const std::string& form_name) {
  if (targets.empty()) return;
  expect_no_target_twice(targets);
  const PoseForm form = form_name == "tum" ? PoseForm::kTum : PoseForm::kJson;
  std::vector<std::unique_ptr<PoseOutput>> outputs;
  try {
    for (const std::string& target : targets) outputs.push_back(open_pose_output(target, form));
  } catch (const std::runtime_error& error) {
    throw IoError("--poses", error.what());
  }
  // The output has its own descriptor of what standard output was.
  if (std::count(targets.begin(), targets.end(), "-") > 0) ::dup2(STDERR_FILENO, STDOUT_FILENO);
  streams_.emplace(std::move(outputs), form);
}

void PoseStreaming::listen(EngineOptions& options) {
  if (!streams_) return;
  reporter_.listen(options);
  const auto put = [this](const PoseOrEvent& item) { streams_->tell(item); };
  options.on_pose =
      both(options.on_pose,
           PoseListener([this, put](const PoseReport& report) { reporter_.tell(report, put, put); }));
}

void PoseStreaming::finish() {
  if (streams_) streams_->finish();
}

std::vector<std::string> PoseStreaming::problems() const {
  return streams_ ? streams_->problems() : std::vector<std::string>();
}

}  // namespace twofold
