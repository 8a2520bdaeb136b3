#pragma once

#include <string>
#include <vector>

#include "engine/options.hpp"
#include "slam/pose_reporter.hpp"
#include "streams/pose_streams.hpp"

namespace twofold {

/// Poses of a run while it runs, as --poses asks for them.
class PoseStreaming {
 public:
  /// Throws IoError naming the target. If one is standard output, what the program has to say to people goes
  /// to standard error from here on.
  PoseStreaming(const std::vector<std::string>& targets, const std::string& form);

  /// Adds its listeners to those of `options`, if anybody asked; this object must outlive the run.
  void listen(EngineOptions& options);
  /// After the run.
  void finish();
  /// After that: what was not written, as to a disk that is full, a sentence an output.
  [[nodiscard]] std::vector<std::string> problems() const;

 private:
  PoseReporter reporter_;  // tracker's
  std::optional<PoseStreams> streams_;
};

}  // namespace twofold
