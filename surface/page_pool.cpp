#include "surface/page_pool.hpp"

#include <sys/mman.h>

#include <new>

namespace twofold {

std::byte* new_chunk(bool large_page) {
  // Aligned to its size: what was mapped around it is given back.
  constexpr std::size_t kMapped = 2 * kChunkBytes;
  void* mapped = mmap(nullptr, kMapped, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) throw std::bad_alloc();
  auto* begin = static_cast<std::byte*>(mapped);
  std::size_t space = kMapped;
  void* aligned = mapped;
  (void)std::align(kChunkBytes, kChunkBytes, aligned, space);
  auto* chunk = static_cast<std::byte*>(aligned);
  if (chunk != begin) (void)munmap(begin, static_cast<std::size_t>(chunk - begin));
  if (space != kChunkBytes) (void)munmap(chunk + kChunkBytes, space - kChunkBytes);
  // Advice: a kernel without large pages clears small ones, which cost half when they are asked for together.
  (void)madvise(chunk, kChunkBytes, large_page ? MADV_HUGEPAGE : MADV_NOHUGEPAGE);
  if (large_page) (void)madvise(chunk, kChunkBytes, MADV_POPULATE_WRITE);
  return chunk;
}

void return_chunk(std::byte* chunk) {
  (void)munmap(chunk, kChunkBytes);
}

}  // namespace twofold
