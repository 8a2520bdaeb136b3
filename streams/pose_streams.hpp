#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "engine/parking.hpp"
#include "engine/spsc_ring.hpp"
#include "engine/worker.hpp"
#include "streams/pose_output.hpp"

namespace twofold {

/// Hands poses and events to outputs while they arise.
///
/// Roles: the tracker's thread calls the two tell functions, which copy into a ring and wake a thread of this
/// class's own: no lock, no allocation, no system call but the wake. That thread makes lines and offers them
/// to the outputs, none of which waits for its readers. If it falls behind by the whole ring, poses are left
/// out, and all readers are told how many.
class PoseStreams {
 public:
  /// Throws std::system_error when no thread can be made.
  PoseStreams(std::vector<std::unique_ptr<PoseOutput>> outputs, PoseForm form);
  /// Finishes.
  ~PoseStreams() { finish(); }
  PoseStreams(const PoseStreams&) = delete;
  PoseStreams& operator=(const PoseStreams&) = delete;

  void tell(const PoseEstimate& pose) { push(pose); }
  void tell(const MapEvent& event) { push(event); }

  /// The last call of the telling thread, or any after its end: what was told goes out, as far as readers
  /// take it within half a second.
  void finish();

 private:
  using Item = std::variant<PoseEstimate, MapEvent>;
  static constexpr std::size_t kRing = 512;  // 17 s at 30 frames a second

  void push(const Item& item);
  void write(const std::stop_token& stop);
  void write_queued();
  void hand_over_rest();

  std::vector<std::unique_ptr<PoseOutput>> outputs_;
  const PoseForm form_;
  SpscRing<Item> ring_{kRing};
  Parking parking_;
  std::atomic<std::uint64_t> missed_{0};  // relaxed: a count that publishes nothing
  std::optional<Worker> writer_;          // last: joins before what it uses is destroyed
};

}  // namespace twofold
