#include "bench/mapping/live_memory.hpp"

#include <malloc.h>

#include <cstdio>
#include <cstdlib>
#include <new>

#include <unistd.h>

// The allocator keeps freed blocks in caches which its own statistics count as taken, so the program's
// blocks are counted one by one. The program has one thread.
namespace {

std::size_t live = 0;

void* counted(void* block) {
  if (block == nullptr) throw std::bad_alloc();
  live += malloc_usable_size(block);
  return block;
}

void forget(void* block) {
  if (block != nullptr) live -= malloc_usable_size(block);
  std::free(block);
}

}  // namespace

void* operator new(std::size_t size) {
  return counted(std::malloc(size == 0 ? 1 : size));
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto a = static_cast<std::size_t>(alignment);
  return counted(std::aligned_alloc(a, (size + a - 1) / a * a));
}
void operator delete(void* block) noexcept {
  forget(block);
}
void operator delete(void* block, std::size_t) noexcept {
  forget(block);
}
void operator delete(void* block, std::align_val_t) noexcept {
  forget(block);
}
void operator delete(void* block, std::size_t, std::align_val_t) noexcept {
  forget(block);
}

namespace twofold {

std::size_t live_heap_bytes() {
  return live;
}

std::size_t resident_bytes() {
  malloc_trim(0);
  unsigned long total = 0, resident = 0;
  std::FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr) return 0;
  const int fields = std::fscanf(file, "%lu %lu", &total, &resident);
  std::fclose(file);
  return fields == 2 ? resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) : 0;
}

}  // namespace twofold
