#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/worker.hpp"
#include "streams/pose_output.hpp"
#include "twofold/pose_queue.hpp"

namespace twofold {

/// Hands poses and events to outputs while they arise.
///
/// Roles: the tracker's thread calls tell, which puts into a queue. A thread of this class's own reads it,
/// makes lines and offers them to the outputs, none of which waits for its readers. If it falls behind by the
/// whole queue, poses are left out, and all readers are told how many.
class PoseStreams {
 public:
  /// Throws std::system_error when no thread can be made.
  PoseStreams(std::vector<std::unique_ptr<PoseOutput>> outputs, PoseForm form);
  /// Finishes.
  ~PoseStreams() { finish(); }
  PoseStreams(const PoseStreams&) = delete;
  PoseStreams& operator=(const PoseStreams&) = delete;

  void tell(const PoseOrEvent& item) { queue_.put(item); }

  /// The last call of the telling thread, or any after its end: what was told goes out, as far as readers
  /// take it within half a second. A disk that hangs is waited for.
  void finish();
  /// After that: of each output, what its reader cannot know.
  [[nodiscard]] std::vector<std::string> problems() const;

 private:
  void write_all();
  void write(const PoseOrEvent& item);
  void hand_over_rest();

  std::vector<std::unique_ptr<PoseOutput>> outputs_;
  const PoseForm form_;
  PoseQueue queue_;
  std::optional<Worker> writer_;  // last: joins before what it uses is destroyed
};

}  // namespace twofold
