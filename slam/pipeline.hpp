#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "engine/lockstep_run.hpp"
#include "engine/threaded_run.hpp"
#include "twofold/queue_lengths.hpp"

namespace twofold {

/// The engine, one frame at a time, whichever way it runs. Calls are made by one thread at a time, unless it
/// says otherwise.
class Pipeline {
 public:
  virtual ~Pipeline() = default;

  /// Whether a frame can be pushed now.
  [[nodiscard]] virtual bool has_buffer() = 0;
  /// Likewise, and whether map and disk follow a run that has no clock to keep.
  [[nodiscard]] virtual bool has_room() = 0;
  /// Records of frames that are done go to the run's logs; has_buffer and has_room see to it, too.
  virtual void collect() = 0;
  virtual void push(Frame frame) = 0;
  /// Sleeps until something may have changed; not beyond `deadline`.
  virtual void wait(std::chrono::steady_clock::time_point deadline) = 0;
  /// A thread has ended early: what is pushed now is not tracked, and the result says why.
  [[nodiscard]] virtual bool failed() = 0;
  /// What the run's logs have lost so far, as on a disk that is full: a sentence a file.
  [[nodiscard]] virtual std::vector<std::string> log_errors() const = 0;
  /// Any thread, wait-free, until finish has returned.
  [[nodiscard]] virtual QueueLengths waiting() const = 0;
  /// The last call.
  [[nodiscard]] virtual RunResult finish() = 0;
};

/// Threaded, or deterministic if `options` say so. Throws std::runtime_error when an option is invalid.
[[nodiscard]] std::unique_ptr<Pipeline> make_pipeline(const Rig& rig, const EngineOptions& options);

}  // namespace twofold
