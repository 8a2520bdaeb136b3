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
  std::atomic<bool> taken_{
      false};  // relaxed: nothing is handed over with it, and a late reader loses nothing
};

/// Takes the right of way for its scope; nothing for a null pointer.
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

/// While it lives, make_way on the thread that made it waits while `right` is taken; one at a time a thread.
class MakesWay {
 public:
  /// @param longest  so long does make_way wait at most, and then for as long not at all: where the other
  ///                 thread never rests, half of the time is left
  explicit MakesWay(const RightOfWay& right,
                    std::chrono::nanoseconds longest = std::chrono::milliseconds(10));
  ~MakesWay();
  MakesWay(const MakesWay&) = delete;
  MakesWay& operator=(const MakesWay&) = delete;
};

/// To be called in the inner loops of long work, every few microseconds to a millisecond. Returns at once on
/// threads that make way for nobody.
void make_way();

}  // namespace twofold
