#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/logs/log_file.hpp"
#include "engine/parking.hpp"
#include "engine/worker.hpp"

namespace twofold {

/// A thread that writes what was appended to log files, ten times a second: whoever appends never waits for
/// the disk.
class LogWriter {
 public:
  /// Throws std::system_error when no thread can be made.
  explicit LogWriter(std::vector<std::shared_ptr<LogFile>> files);

  /// Whether a file is behind; any thread.
  [[nodiscard]] bool behind() const;
  /// Returns when none is. For those who have time.
  void wait_for_room() const;
  /// What was lost so far, and what waits for room on the disk, a sentence a file; any thread.
  [[nodiscard]] std::vector<std::string> errors() const;
  /// After the last append: writes what waits and ends the thread. What was lost, as errors.
  [[nodiscard]] std::vector<std::string> finish();

 private:
  std::vector<std::shared_ptr<LogFile>> files_;
  Parking parking_;
  std::optional<Worker> thread_;  // last: joins before what it uses is destroyed
};

}  // namespace twofold
