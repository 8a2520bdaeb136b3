#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <variant>

#include "twofold/estimate.hpp"

namespace twofold {

using PoseOrEvent = std::variant<PoseEstimate, MapEvent>;

enum class QueueStatus : std::uint8_t {
  kItem,     ///< there was one
  kTimeout,  ///< none came in time
  kEnd       ///< the queue is closed, and everything was read
};

/// Poses and events for a thread that wants to take its time, which callbacks may not:
///
///   PoseQueue queue;
///   slam.on_pose([&](const PoseEstimate& pose) { queue.put(pose); });
///   std::jthread reader([&] {
///     for (PoseOrEvent item; queue.next(item) == QueueStatus::kItem;) ...;
///   });
///   ... push all frames ...
///   slam.finish();  // until then the queue is filled
///   queue.close();  // the reader gets what is left, then the end
///
/// Roles: one thread at a time puts (callbacks of one Slam do), one reads, one may wait for room; anyone
/// closes and asks for what was missed.
/// put is wait-free: it copies into a ring of `capacity` items, and makes a system call only to wake a reader
/// that sleeps. Full: the item is left out and counted.
class TWOFOLD_API PoseQueue {
 public:
  static constexpr std::int64_t kForEver = -1;

  /// @param capacity  rounded up to a power of two; 512 are 17 s at 30 frames a second. Throws
  ///                  std::invalid_argument for none and for more than 2^24
  explicit PoseQueue(std::size_t capacity = 512);
  ~PoseQueue();
  PoseQueue(const PoseQueue&) = delete;
  PoseQueue& operator=(const PoseQueue&) = delete;

  void put(const PoseOrEvent& item);
  /// Waits for the oldest item, at most for `timeout_ns`.
  [[nodiscard]] QueueStatus next(PoseOrEvent& item, std::int64_t timeout_ns = kForEver);
  /// Nothing is put any more: the reader gets what is left, and then the end.
  void close();
  [[nodiscard]] bool closed() const;

  /// For whoever paces the putting: waits until `items` more fit, at most for `timeout_ns`. Returns early,
  /// with false, when the queue is closed. Throws std::invalid_argument for more than the queue holds.
  [[nodiscard]] bool wait_for_room(std::size_t items, std::int64_t timeout_ns = kForEver);
  /// How many were left out since the last call.
  [[nodiscard]] std::uint64_t take_missed();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
