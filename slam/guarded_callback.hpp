#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "engine/thrown.hpp"

namespace twofold {

/// A user's function that the tracker calls: until it throws.
///
/// Roles: `set` before the first call; one thread calls; anyone asks for the error.
/// Ordering: failed_ release -> acquire publishes what_, which is written once.
template <class... Arguments>
class GuardedCallback {
 public:
  using Function = std::function<void(const Arguments&...)>;

  explicit GuardedCallback(std::string name) : name_(std::move(name)) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  void set(Function function) { function_ = std::move(function); }

  void operator()(const Arguments&... arguments) {
    if (!function_ || failed_.load(std::memory_order_relaxed)) return;  // relaxed: raised by this thread
    try {
      function_(arguments...);
    } catch (...) {
      fail(what_was_thrown());
    }
  }

  [[nodiscard]] std::optional<std::string> error() const {
    if (!failed_.load(std::memory_order_acquire)) return std::nullopt;
    return what_;
  }

 private:
  void fail(const std::string& what) {
    what_ = "the callback of " + name_ + " threw, and is not called any more: " + what;
    failed_.store(true, std::memory_order_release);
  }

  const std::string name_;
  Function function_;
  std::string what_;
  std::atomic<bool> failed_{false};
};

}  // namespace twofold
