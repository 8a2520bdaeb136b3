#pragma once

#include <cstdio>
#include <cstdlib>

namespace twofold {

[[noreturn]] inline void check_failed(const char* condition, const char* context, const char* file,
                                      int line) {
  std::fprintf(stderr, "%s:%d: check failed: %s (%s)\n", file, line, condition, context);
  std::abort();
}

}  // namespace twofold

/// Aborts when a condition that only a bug can break does not hold. Active in every build type.
#define TWOFOLD_CHECK(condition, context) \
  ((condition) ? static_cast<void>(0) : ::twofold::check_failed(#condition, context, __FILE__, __LINE__))
