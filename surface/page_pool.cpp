#include "surface/page_pool.hpp"

#include <sys/mman.h>

#include <new>

namespace twofold {

std::byte* new_chunk() {
  void* chunk = mmap(nullptr, kChunkBytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (chunk == MAP_FAILED) throw std::bad_alloc();
  // Advice: a kernel that does not know it clears each page when it is written to.
  (void)madvise(chunk, kChunkBytes, MADV_POPULATE_WRITE);
  return static_cast<std::byte*>(chunk);
}

void return_chunk(std::byte* chunk) {
  (void)munmap(chunk, kChunkBytes);
}

}  // namespace twofold
