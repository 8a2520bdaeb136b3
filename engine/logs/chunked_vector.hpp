#pragma once

#include <cstddef>
#include <vector>

#include "engine/logs/index_iterator.hpp"

namespace twofold {

/// Sequence that grows at its end, for as long as a run goes on, and copies none of its values when it does:
/// they lie in chunks of kChunk, and only the list of chunks is moved now and then.
template <class T, std::size_t kChunk = 256>
class ChunkedVector {
 public:
  using value_type = T;

  void push_back(const T& value) {
    if (chunks_.empty() || chunks_.back().size() == kChunk) chunks_.emplace_back().reserve(kChunk);
    chunks_.back().push_back(value);
    ++size_;
  }

  /// The values of the first chunk; there must be one, and it must be full. The others move down.
  void forget_first_chunk() {
    chunks_.erase(chunks_.begin());
    size_ -= kChunk;
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return chunks_[i / kChunk][i % kChunk]; }
  [[nodiscard]] T& operator[](std::size_t i) { return chunks_[i / kChunk][i % kChunk]; }
  [[nodiscard]] const T& front() const { return (*this)[0]; }
  [[nodiscard]] const T& back() const { return (*this)[size_ - 1]; }
  /// The chunks in their order; all but the last are full.
  [[nodiscard]] const std::vector<std::vector<T>>& chunks() const { return chunks_; }

  using const_iterator = IndexIterator<ChunkedVector, T>;
  [[nodiscard]] const_iterator begin() const { return {*this, 0}; }
  [[nodiscard]] const_iterator end() const { return {*this, size_}; }

 private:
  std::vector<std::vector<T>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace twofold
