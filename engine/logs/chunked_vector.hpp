#pragma once

#include <cstddef>
#include <iterator>
#include <vector>

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

  class const_iterator {
   public:
    using iterator_category = std::forward_iterator_tag;
    using value_type = T;
    using difference_type = std::ptrdiff_t;
    using pointer = const T*;
    using reference = const T&;

    const_iterator() = default;
    const_iterator(const ChunkedVector& vector, std::size_t i) : vector_(&vector), i_(i) {}
    reference operator*() const { return (*vector_)[i_]; }
    pointer operator->() const { return &(*vector_)[i_]; }
    const_iterator& operator++() {
      ++i_;
      return *this;
    }
    const_iterator operator++(int) {
      const const_iterator before = *this;
      ++i_;
      return before;
    }
    bool operator==(const const_iterator&) const = default;

   private:
    const ChunkedVector* vector_ = nullptr;
    std::size_t i_ = 0;
  };
  [[nodiscard]] const_iterator begin() const { return {*this, 0}; }
  [[nodiscard]] const_iterator end() const { return {*this, size_}; }

 private:
  std::vector<std::vector<T>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace twofold
