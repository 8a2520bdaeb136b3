#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <utility>

#include "geometry/check.hpp"

namespace twofold {

/// Vector whose copies share structure: a tree of fan-out 2^kBits with values in chunks of that size at the
/// leaves.
///
/// Copy: O(1). Read: O(log n). push_back, mutate: O(log n), and copies a node only if another version shares
/// it.
///
/// Threads. One thread (the writer) copies, changes and destroys versions; others may only read a version
/// that was published to them and that the writer keeps alive. Whether a node is shared is asked of its use
/// count: it can only be raised by copying, which only the writer does, so a count of one means that no
/// published version has the node.
template <class T, int kBits = 5>
class PersistentVector {
  static constexpr std::size_t kWidth = std::size_t{1} << kBits;
  static constexpr std::size_t kMask = kWidth - 1;
  struct Node {
    virtual ~Node() = default;
    Node() = default;
    Node(const Node&) = default;
    Node& operator=(const Node&) = delete;
  };
  struct Inner final : Node {
    std::array<std::shared_ptr<Node>, kWidth> children;
  };
  struct Leaf final : Node {
    std::array<T, kWidth> values{};
  };

 public:
  static constexpr std::size_t kChunk = kWidth;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }

  /// i < size().
  [[nodiscard]] const T& operator[](std::size_t i) const {
    const Node* node = root_.get();
    for (int shift = shift_; shift > 0; shift -= kBits) {
      node = static_cast<const Inner*>(node)->children[(i >> shift) & kMask].get();
    }
    if (!node) return forgotten();
    return static_cast<const Leaf*>(node)->values[i & kMask];
  }

  /// Reference for writing to entry i < size(); valid until the next copy of this vector.
  [[nodiscard]] T& mutate(std::size_t i) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    return leaf_for_writing(i).values[i & kMask];
  }

  /// Frees the chunk of entry i < size() if `forgettable` holds for all its entries: they then read as T{}
  /// until they are written again. Returns whether it did. Other versions keep theirs.
  template <class Predicate>
  bool forget_chunk_if(std::size_t i, Predicate&& forgettable) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    if (shift_ == 0) return false;
    const std::size_t begin = i & ~kMask;
    for (std::size_t n = begin; n < begin + kWidth && n < size_; ++n) {
      if (!forgettable((*this)[n])) return false;
    }
    std::shared_ptr<Node>* slot = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) {
      slot = &own<Inner>(*slot).children[(i >> shift) & kMask];
    }
    slot->reset();
    return true;
  }

  void push_back(T value) {
    if (size_ == capacity()) grow();
    leaf_for_writing(size_).values[size_ & kMask] = std::move(value);
    ++size_;
  }

 private:
  static const T& forgotten() {
    static const T value{};
    return value;
  }
  [[nodiscard]] std::size_t capacity() const { return root_ ? kWidth << shift_ : 0; }

  void grow() {
    if (!root_) {
      root_ = std::make_shared<Leaf>();
      return;
    }
    auto above = std::make_shared<Inner>();
    above->children[0] = std::move(root_);
    root_ = std::move(above);
    shift_ += kBits;
  }

  template <class N>
  static N& own(std::shared_ptr<Node>& slot) {
    if (!slot) {
      slot = std::make_shared<N>();
    } else if (slot.use_count() > 1) {
      slot = std::make_shared<N>(static_cast<const N&>(*slot));
    }
    return static_cast<N&>(*slot);
  }

  Leaf& leaf_for_writing(std::size_t i) {
    std::shared_ptr<Node>* slot = &root_;
    for (int shift = shift_; shift > 0; shift -= kBits) {
      slot = &own<Inner>(*slot).children[(i >> shift) & kMask];
    }
    return own<Leaf>(*slot);
  }

  std::shared_ptr<Node> root_;
  std::size_t size_ = 0;
  int shift_ = 0;
};

}  // namespace twofold
