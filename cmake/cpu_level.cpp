// Compiled for the oldest x86-64, whatever the rest is compiled for, so that this check itself cannot trap.

#include <unistd.h>

#include <cstring>

namespace {

/// Runs before every other initialiser of the program, or of the shared library: those are compiled for
/// TWOFOLD_ARCH already, so that nothing can be thrown to whoever loads the library either.
__attribute__((constructor(101))) void check_cpu_level() {
  __builtin_cpu_init();
  if (__builtin_cpu_supports(TWOFOLD_ARCH)) return;
  static const char kMessage[] =
      TWOFOLD_BINARY ": this processor lacks instructions of " TWOFOLD_ARCH
                     ", which it was built for; build the preset release-v2 instead\n";
  (void)!write(STDERR_FILENO, kMessage, std::strlen(kMessage));
  _exit(2);
}

}  // namespace
