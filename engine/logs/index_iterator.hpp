#pragma once

#include <cstddef>
#include <iterator>

namespace twofold {

/// Walks over a sequence of T that knows operator[] only. Stays valid while the sequence grows.
template <class Sequence, class T>
class IndexIterator {
 public:
  using iterator_category = std::forward_iterator_tag;
  using value_type = T;
  using difference_type = std::ptrdiff_t;
  using pointer = const T*;
  using reference = const T&;

  IndexIterator() = default;
  IndexIterator(const Sequence& sequence, std::size_t i) : sequence_(&sequence), i_(i) {}
  reference operator*() const { return (*sequence_)[i_]; }
  pointer operator->() const { return &(*sequence_)[i_]; }
  IndexIterator& operator++() {
    ++i_;
    return *this;
  }
  IndexIterator operator++(int) {
    const IndexIterator before = *this;
    ++i_;
    return before;
  }
  bool operator==(const IndexIterator&) const = default;

 private:
  const Sequence* sequence_ = nullptr;
  std::size_t i_ = 0;
};

}  // namespace twofold
