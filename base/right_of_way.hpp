#pragma once

#include <atomic>
#include <chrono>

namespace twofold {

/// A thread that must not be late says here when it is at work, and threads that can wait do nothing in the
/// meantime. Priorities alone do not keep them apart: on another core they take caches and memory from it,
/// and half of its core where two processors are one core's two threads.
class RightOfWay {
 public:
  void take() { taken_.store(true, std::memory_order_relaxed); }
  void give_up() { taken_.store(false, std::memory_order_relaxed); }
  [[nodiscard]] bool taken() const { return taken_.load(std::memory_order_relaxed); }

 private:
  // Relaxed: nothing is handed over with it, and a late reader loses nothing.
  std::atomic<bool> taken_{false};
};

/// Takes the right of way for its scope; does nothing if it is null. Not nested: the inner one would give up
/// the outer one's.
class RightOfWayTaken {
 public:
  explicit RightOfWayTaken(RightOfWay* right) : right_(right) {
    if (right_ != nullptr) right_->take();
  }
  ~RightOfWayTaken() {
    if (right_ != nullptr) right_->give_up();
  }
  RightOfWayTaken(const RightOfWayTaken&) = delete;
  RightOfWayTaken& operator=(const RightOfWayTaken&) = delete;

 private:
  RightOfWay* right_;
};

/// While it lives, make_way on the thread that made it waits while `right` is taken. At most one a thread.
class MakesWay {
 public:
  /// @param right    must outlive this
  /// @param longest  of one wait; after one that reached it, make_way does not wait for as long. So half of
  ///                 the time is left beside a thread that never rests, and its rests beside one that does
  explicit MakesWay(const RightOfWay& right,
                    std::chrono::nanoseconds longest = std::chrono::milliseconds(10));
  ~MakesWay();
  MakesWay(const MakesWay&) = delete;
  MakesWay& operator=(const MakesWay&) = delete;
};

/// To be called in the inner loops of long work, every few microseconds to a millisecond, without locks that
/// the other thread may want. Returns at once on threads that make way for nobody.
void make_way();

}  // namespace twofold
