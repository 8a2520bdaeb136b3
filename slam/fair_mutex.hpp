#pragma once

#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace twofold {

/// A mutex whose owners take turns in the order they came: who gives it up and wants it again at once does
/// not get it before those who wait. BasicLockable, with try_lock.
class FairMutex {
 public:
  void lock() {
    std::unique_lock lock(lock_);
    const std::uint64_t turn = next_++;
    changed_.wait(lock, [&] { return turn == serving_; });
  }
  [[nodiscard]] bool try_lock() {
    const std::scoped_lock lock(lock_);
    if (next_ != serving_) return false;
    ++next_;
    return true;
  }
  void unlock() {
    {
      const std::scoped_lock lock(lock_);
      ++serving_;
    }
    changed_.notify_all();
  }
  /// How many have it or wait for it.
  [[nodiscard]] std::uint64_t queue() const {
    const std::scoped_lock lock(lock_);
    return next_ - serving_;
  }

 private:
  mutable std::mutex lock_;  // held for a few instructions; guards what follows
  std::condition_variable changed_;
  std::uint64_t next_ = 0, serving_ = 0;
};

}  // namespace twofold
