#pragma once

#include <cstdint>

namespace twofold::testing {

/// Heap allocations of this thread since the program's start: malloc and its relatives, so operator new and
/// OpenCV's buffers too.
[[nodiscard]] std::uint64_t allocations();
/// False under sanitizers, which have an allocator of their own.
[[nodiscard]] bool allocations_are_counted();

}  // namespace twofold::testing
