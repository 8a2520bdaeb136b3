#pragma once

#include <cstddef>

namespace twofold {

/// Bytes the program has from operator new and not yet given back.
[[nodiscard]] std::size_t live_heap_bytes();

/// Memory of the process that is in RAM now, after giving back what the allocator holds in reserve.
[[nodiscard]] std::size_t resident_bytes();

}  // namespace twofold
