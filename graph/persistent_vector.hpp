#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <utility>

#include "geometry/check.hpp"

namespace twofold {

/// Vector whose copies share structure: a tree of fan-out 2^kBits with values in chunks of 2^kLeafBits at the
/// leaves. Chunks that were never written, or forgotten, take no memory.
///
/// Copy: O(1). Read: O(log n). push_back, mutate: O(log n), and copies a node only if another version shares
/// it.
///
/// Threads. One thread (the writer) copies, changes and destroys versions; others may only read a version
/// that was published to them and that the writer keeps alive. Whether a node is shared is asked of its use
/// count: it can only be raised by copying, which only the writer does, so a count of one means that no
/// published version has the node.
template <class T, int kBits = 5, int kLeafBits = kBits>
class PersistentVector {
  static constexpr std::size_t kWidth = std::size_t{1} << kBits;
  static constexpr std::size_t kLeafWidth = std::size_t{1} << kLeafBits;
  static constexpr std::size_t kLeafMask = kLeafWidth - 1;
  static constexpr int kMaxHeight = 64 / kBits + 1;
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
    std::array<T, kLeafWidth> values{};
  };

 public:
  static constexpr std::size_t kChunk = kLeafWidth;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }

  /// i < size().
  [[nodiscard]] const T& operator[](std::size_t i) const {
    const Node* node = root_.get();
    for (int level = height_; level > 0 && node; --level) {
      node = static_cast<const Inner*>(node)->children[child_at(level, i)].get();
    }
    if (!node) return forgotten();
    return static_cast<const Leaf*>(node)->values[i & kLeafMask];
  }

  /// Reference for writing to entry i < size(); valid until the next copy of this vector.
  [[nodiscard]] T& mutate(std::size_t i) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    return leaf_for_writing(i).values[i & kLeafMask];
  }

  /// Frees the chunk of entry i < size() if `forgettable` holds for all its entries: they then read as T{}
  /// until they are written again. Returns whether it did. Other versions keep theirs.
  template <class Predicate>
  bool forget_chunk_if(std::size_t i, Predicate&& forgettable) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    if (height_ == 0) return false;
    const std::size_t begin = i & ~kLeafMask;
    for (std::size_t n = begin; n < begin + kLeafWidth && n < size_; ++n) {
      if (!forgettable((*this)[n])) return false;
    }
    std::array<std::shared_ptr<Node>*, kMaxHeight> path;  // by level; the chunk's own is level 0
    path[static_cast<std::size_t>(height_)] = &root_;
    for (int level = height_; level > 0; --level) {
      const auto at = static_cast<std::size_t>(level);
      path[at - 1] = &own<Inner>(*path[at]).children[child_at(level, i)];
    }
    path[0]->reset();
    // Nodes that lead nowhere go too, the root excepted.
    for (int level = 1; level < height_; ++level) {
      const auto& slot = *path[static_cast<std::size_t>(level)];
      const auto& children = static_cast<const Inner&>(*slot).children;
      if (std::any_of(children.begin(), children.end(), [](const auto& child) { return child != nullptr; }))
        break;
      path[static_cast<std::size_t>(level)]->reset();
    }
    return true;
  }

  void push_back(T value) {
    extend(size_ + 1);
    leaf_for_writing(size_ - 1).values[(size_ - 1) & kLeafMask] = std::move(value);
  }

  /// Makes the vector at least `size` long; new entries read as T{}, and take no memory before they are
  /// written.
  void extend(std::size_t size) {
    while (capacity() < size) grow();
    size_ = std::max(size_, size);
  }

 private:
  static const T& forgotten() {
    static const T value{};
    return value;
  }
  /// Which child of a node at `level` >= 1 (leaves are at 0) leads to entry i.
  [[nodiscard]] static std::size_t child_at(int level, std::size_t i) {
    return (i >> (kLeafBits + kBits * (level - 1))) & (kWidth - 1);
  }
  [[nodiscard]] std::size_t capacity() const { return root_ ? kLeafWidth << (kBits * height_) : 0; }

  void grow() {
    if (!root_) {
      root_ = std::make_shared<Leaf>();
      return;
    }
    auto above = std::make_shared<Inner>();
    above->children[0] = std::move(root_);
    root_ = std::move(above);
    ++height_;
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
    for (int level = height_; level > 0; --level) {
      slot = &own<Inner>(*slot).children[child_at(level, i)];
    }
    return own<Leaf>(*slot);
  }

  std::shared_ptr<Node> root_;
  std::size_t size_ = 0;
  int height_ = 0;  ///< levels of inner nodes
};

}  // namespace twofold
