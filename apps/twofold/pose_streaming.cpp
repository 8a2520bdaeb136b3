#include "apps/twofold/pose_streaming.hpp"

#include <unistd.h>

#include <algorithm>

#include <fmt/format.h>

#include "io/files/io_error.hpp"

namespace twofold {

PoseStreaming::PoseStreaming(const std::vector<std::string>& targets, const std::string& form_name) {
  if (targets.empty()) return;
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

PoseListener PoseStreaming::listener() {
  if (!streams_) return {};
  return [this](const PoseReport& report) {
    PoseReporter::Events events;
    const PoseEstimate pose = reporter_.next(report, events);
    if (events.correction) streams_->tell(*events.correction);
    if (events.placing) streams_->tell(*events.placing);
    streams_->tell(pose);
  };
}

void PoseStreaming::finish() {
  if (streams_) streams_->finish();
}

void PoseStreaming::expect_success() const {
  if (!streams_) return;
  const std::vector<std::string> problems = streams_->problems();
  if (!problems.empty()) throw IoError("--poses", fmt::format("{}", fmt::join(problems, "; ")));
}

}  // namespace twofold
