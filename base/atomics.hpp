#pragma once

#include <atomic>
#include <cstddef>

namespace twofold {

/// Distance that keeps two threads' words out of one cache line (x86-64, most ARM cores). A constant rather
/// than std::hardware_destructive_interference_size, whose value follows -mtune and would change public
/// layouts.
inline constexpr std::size_t kCacheLine = 64;

/// Where the concurrent classes take their atomics from. The tests of tests/models put a model checker's
/// atomics here, so that what is checked is the very source that runs.
struct StdAtomics {
  template <class V>
  using Atomic = std::atomic<V>;
};

}  // namespace twofold
