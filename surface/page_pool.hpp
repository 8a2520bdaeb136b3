#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <vector>

namespace twofold {

/// Whole pages of the system's, all zero.
inline constexpr std::size_t kChunkBytes = std::size_t{1} << 17;
/// The kernel gives the pages of a chunk together, without a fault for each. They are small ones: a large
/// page is cleared in one piece, while the tracker may want the processor, and where a hypervisor takes back
/// what is free, a large page mostly has to come from it anew, which takes several times as long as clearing
/// as many small ones. Throws std::bad_alloc.
[[nodiscard]] std::byte* new_chunk();
void return_chunk(std::byte* chunk);

/// Objects that lie in pages of their own: what is given back goes back to the system, where on the heap it
/// would be holes among what others keep. References stay valid until clear. An object whose bytes are all
/// zero must be a new one.
template <class T>
class PagePool {
 public:
  [[nodiscard]] T& operator[](std::size_t i) { return at(i); }
  [[nodiscard]] const T& operator[](std::size_t i) const { return at(i); }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// Throws std::bad_alloc.
  T& add() {
    if (size_ % kInChunk == 0) chunks_.push_back(Chunk(new_chunk()));
    return at(size_++);
  }
  void clear() {
    chunks_.clear();
    size_ = 0;
  }
  [[nodiscard]] std::size_t bytes() const {
    return chunks_.size() * kChunkBytes + chunks_.capacity() * sizeof(chunks_[0]);
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
