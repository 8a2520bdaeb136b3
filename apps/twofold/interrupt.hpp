#pragma once

#include <atomic>

namespace twofold {

/// True once the user has asked for the end, with Ctrl-C, SIGTERM or SIGHUP, after catch_interrupts().
[[nodiscard]] const std::atomic<bool>& interrupted();

/// As the user would, from within the program; any thread.
void interrupt();

/// From here on SIGINT, SIGTERM and SIGHUP (unless it is ignored) raise the flag instead of ending the
/// process.
void catch_interrupts();

}  // namespace twofold
