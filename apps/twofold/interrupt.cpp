#include "apps/twofold/interrupt.hpp"

#include <csignal>

namespace twofold {
namespace {

std::atomic<bool> flag{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may touch lock-free atomics only");

// Relaxed, here and where it is read: the flag carries no other data.
void on_interrupt(int) {
  flag.store(true, std::memory_order_relaxed);
}

}  // namespace

const std::atomic<bool>& interrupted() {
  return flag;
}

void interrupt() {
  on_interrupt(0);
}

void catch_interrupts() {
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  // The terminal is closed. Under nohup it is ignored, and stays so.
  if (std::signal(SIGHUP, on_interrupt) == SIG_IGN) std::signal(SIGHUP, SIG_IGN);
}

}  // namespace twofold
