#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "engine/logs/log_file.hpp"
#include "engine/parking.hpp"
#include "engine/worker.hpp"

namespace twofold {

/// A thread that writes what was appended to log files, time and again: whoever appends never waits for the
/// disk.
class LogWriter {
 public:
  /// Throws std::system_error when no thread can be made.
  /// @param before_look  called on the thread before it looks what waits; tests let it fail
  /// @param period       from one look to the next, unless a file is behind
  explicit LogWriter(std::vector<std::shared_ptr<LogFile>> files, std::function<void()> before_look = {},
                     std::chrono::milliseconds period = std::chrono::milliseconds(100));

  /// Whether a file is behind, and somebody there who will write it; any thread.
  [[nodiscard]] bool behind() const;
  /// Has what waits written at once if a file is behind, and returns when none is, or when the thread has
  /// failed, which finish reports. For those who have time; any thread.
  void wait_for_room();
  /// What was lost so far, and what waits for room on the disk, a sentence a file; any thread.
  [[nodiscard]] std::vector<std::string> errors() const;
  /// After the last append: writes what waits and ends the thread. What was lost, as errors.
  [[nodiscard]] std::vector<std::string> finish();

 private:
  [[nodiscard]] bool file_is_behind() const;

  std::vector<std::shared_ptr<LogFile>> files_;
  Parking parking_;
  std::mutex looking_;  // guards nothing: whoever waits holds it between looking at the files and sleeping
  std::condition_variable written_;
  std::optional<Worker> thread_;  // last: joins before what it uses is destroyed
};

}  // namespace twofold
