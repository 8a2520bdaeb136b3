#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <tl/expected.hpp>
#include <vector>

namespace twofold {

struct WorkerOptions {
  std::string name = "worker";            ///< shown by top and debuggers, where cut to 15 characters
  std::optional<int> cpu = std::nullopt;  ///< run on this CPU only, >= 0
  std::optional<int> fifo_priority = std::nullopt;  ///< run under SCHED_FIFO with this priority, in [1, 99]
  /// How long the thread runs before the scheduler looks for another; 100 us to 100 ms. One that wakes takes
  /// the place of one with a longer slice at once, and shares stay as they are (EEVDF, Linux 6.12). Older
  /// kernels give all threads the same slice, about 3 ms: that long a frame may wait behind the mapper.
  std::optional<std::chrono::microseconds> time_slice = std::nullopt;

  /// Empty when valid; otherwise names the field, the rule and the value. Whether the system grants what is
  /// valid shows when a thread asks for it.
  [[nodiscard]] std::string invalid_reason() const;
};

constexpr std::chrono::microseconds kPromptSlice{
    500};  ///< for threads somebody waits for: tracker, pose writer
constexpr std::chrono::microseconds kPatientSlice{20000};  ///< for threads that work in the background

/// Applies the options to the calling thread. Returns one line for each wish that was not granted, saying why
/// and what to do; the thread runs on without it. Options that are not valid are refused likewise.
[[nodiscard]] std::vector<std::string> configure_this_thread(const WorkerOptions& options);
/// Lets the calling thread run when the others leave time.
void yield_to_other_threads();
/// Keeps all memory of the process, present and future, from being paged out. Error: why not, and what to do.
[[nodiscard]] tl::expected<void, std::string> lock_memory();

/// A thread that runs one function, and what became of it. No exception leaves the thread: it ends the
/// function and is reported by join.
class Worker {
 public:
  /// Starts the thread and returns when its options, which must be valid, are applied. Throws
  /// std::system_error when no thread can be made.
  Worker(WorkerOptions options, std::function<void(std::stop_token)> body);
  /// Requests a stop and joins.
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Asks the body to return; anyone, any number of times. Sleepers in Parking::wait with the body's token
  /// wake.
  void request_stop() { thread_.request_stop(); }
  /// Waits for the body to return. Error: "NAME: " and what the exception that ended it said.
  [[nodiscard]] tl::expected<void, std::string> join();
  /// Whether the body has returned or failed; anyone.
  [[nodiscard]] bool finished() const { return finished_.load(std::memory_order_acquire); }
  /// Wishes in the options that were not granted.
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }
  [[nodiscard]] const std::string& name() const { return options_.name; }

 private:
  void run(const std::stop_token& stop, const std::function<void(std::stop_token)>& body);

  WorkerOptions options_;
  std::vector<std::string> notes_;     // written before started_ is raised
  std::optional<std::string> error_;   // written before finished_
  std::atomic<bool> started_{false};   // release -> acquire publishes notes_
  std::atomic<bool> finished_{false};  // release -> acquire publishes error_
  std::jthread thread_;                // last member: starts after, and joins before, everything it uses
};

}  // namespace twofold
