#include "engine/logs/log_writer.hpp"

#include <algorithm>

namespace twofold {
namespace {

constexpr auto kFailureCheck = std::chrono::milliseconds(100);

}  // namespace

LogWriter::LogWriter(std::vector<std::shared_ptr<LogFile>> files, std::function<void()> before_look,
                     std::chrono::milliseconds period)
    : files_(std::move(files)) {
  thread_.emplace(WorkerOptions{.name = "log writer", .time_slice = kPatientSlice},
                  [this, before_look = std::move(before_look), period](const std::stop_token& stop) {
                    while (!stop.stop_requested()) {
                      (void)parking_.wait_until(stop, std::chrono::steady_clock::now() + period,
                                                [this] { return file_is_behind(); });
                      if (before_look) before_look();
                      for (const auto& file : files_) file->write_waiting();
                      // Whoever looked at the files before this look sleeps by now, and hears it.
                      { const std::scoped_lock lock(looking_); }
                      written_.notify_all();
                    }
                  });
}

bool LogWriter::behind() const {
  return file_is_behind() && !thread_->finished();
}

bool LogWriter::file_is_behind() const {
  return std::any_of(files_.begin(), files_.end(), [](const auto& file) { return file->behind(); });
}

void LogWriter::wait_for_room() {
  if (!behind()) return;
  parking_.wake();
  std::unique_lock lock(looking_);
  // A thread that fails wakes nobody.
  while (!written_.wait_for(lock, kFailureCheck, [this] { return !behind(); })) {
  }
}

std::vector<std::string> LogWriter::errors() const {
  std::vector<std::string> errors;
  for (const auto& file : files_) {
    if (std::string lost = file->error();
        !lost.empty() && std::count(errors.begin(), errors.end(), lost) == 0)
      errors.push_back(std::move(lost));
  }
  return errors;
}

std::vector<std::string> LogWriter::finish() {
  thread_->request_stop();
  const auto outcome = thread_->join();
  for (const auto& file : files_) {
    file->write_waiting();
    file->give_up();
  }
  std::vector<std::string> lost = errors();
  if (!outcome) lost.push_back(outcome.error());
  return lost;
}

}  // namespace twofold
