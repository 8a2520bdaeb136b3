#include "tests/allocation_counter.hpp"

#include <cerrno>
#include <cstddef>

#include "tests/sanitized.hpp"

#if defined(TWOFOLD_TEST_SANITIZED) || !defined(__GLIBC__)
#define TWOFOLD_COUNT_ALLOCATIONS 0
#else
#define TWOFOLD_COUNT_ALLOCATIONS 1
#endif

namespace {
thread_local std::uint64_t count = 0;
}

namespace twofold::testing {
std::uint64_t allocations() {
  return count;
}
bool allocations_are_counted() {
  return TWOFOLD_COUNT_ALLOCATIONS != 0;
}
}  // namespace twofold::testing

#if TWOFOLD_COUNT_ALLOCATIONS

// A program's own malloc takes the place of glibc's everywhere in the process; these hand on to the original.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t n, std::size_t size);
void* __libc_realloc(void* p, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) noexcept {
  ++count;
  return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) noexcept {
  ++count;
  return __libc_calloc(n, size);
}
void* realloc(void* p, std::size_t size) noexcept {
  ++count;
  return __libc_realloc(p, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++count;
  return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++count;
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t size) noexcept {
  ++count;
  *p = __libc_memalign(alignment, size);
  return *p == nullptr ? ENOMEM : 0;
}
}

#endif
