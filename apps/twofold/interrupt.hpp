#pragma once

#include <atomic>

namespace twofold {

/// True once the user has asked for the end, with Ctrl-C or SIGTERM, after catch_interrupts().
[[nodiscard]] const std::atomic<bool>& interrupted();

/// As the user would, from within the program; any thread.
void interrupt();

/// From here on SIGINT and SIGTERM raise the flag instead of ending the process.
void catch_interrupts();

}  // namespace twofold
