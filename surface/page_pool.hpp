#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

namespace twofold {

/// Memory of the system's, aligned to its size, all zero.
inline constexpr std::size_t kChunkBytes = std::size_t{1} << 21;
/// A chunk is a large page of the processor's, so that the kernel clears it at once, and what it holds is
/// reached without a walk through its tables; or it is of small pages, each taken when it is written to.
/// Throws std::bad_alloc.
[[nodiscard]] std::byte* new_chunk(bool large_page);
void return_chunk(std::byte* chunk);

/// Objects that lie in pages of their own: what is given back goes back to the system, where on the heap it
/// would be holes among what others keep. References stay valid until clear. An object whose bytes are all
/// zero must be a new one. The first chunk, which a small volume hardly fills, is of small pages.
template <class T>
class PagePool {
 public:
  [[nodiscard]] T& operator[](std::size_t i) { return at(i); }
  [[nodiscard]] const T& operator[](std::size_t i) const { return at(i); }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Throws std::bad_alloc.
  T& add() {
    if (size_ % kInChunk == 0) chunks_.push_back(Chunk(new_chunk(!chunks_.empty())));
    return at(size_++);
  }
  void clear() {
    chunks_.clear();
    size_ = 0;
  }
  [[nodiscard]] std::size_t bytes() const {
    const std::size_t in_first = std::min(size_, kInChunk) * sizeof(T);
    const std::size_t in_others = chunks_.size() > 1 ? (chunks_.size() - 1) * kChunkBytes : 0;
    return in_first + in_others + chunks_.capacity() * sizeof(chunks_[0]);
  }

 private:
  static_assert(std::is_trivially_destructible_v<T>);
  static constexpr std::size_t kInChunk = kChunkBytes / sizeof(T);
  struct Return {
    void operator()(std::byte* chunk) const { return_chunk(chunk); }
  };
  using Chunk = std::unique_ptr<std::byte, Return>;
  [[nodiscard]] T& at(std::size_t i) const {
    return reinterpret_cast<T*>(chunks_[i / kInChunk].get())[i % kInChunk];
  }

  std::vector<Chunk> chunks_;
  std::size_t size_ = 0;
};

}  // namespace twofold
