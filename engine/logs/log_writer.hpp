#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
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
  /// Has what waits written at once if a file is behind, and returns when none is. For those who have time;
  /// any thread.
  void wait_for_room();
  /// What was lost so far, and what waits for room on the disk, a sentence a file; any thread.
  [[nodiscard]] std::vector<std::string> errors() const;
  /// After the last append: writes what waits and ends the thread. What was lost, as errors.
  [[nodiscard]] std::vector<std::string> finish();

 private:
  std::vector<std::shared_ptr<LogFile>> files_;
  Parking parking_;
  std::mutex round_;  // guards nothing: whoever waits holds it between looking at the files and sleeping
  std::condition_variable written_;
  std::optional<Worker> thread_;  // last: joins before what it uses is destroyed
};

}  // namespace twofold
