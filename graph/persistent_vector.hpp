#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/check.hpp"
#include "graph/shared_array.hpp"

namespace twofold {

/// Vector whose copies share structure: a tree of fan-out 2^kBits with chunks of 2^kLeafBits values at the
/// leaves. Nodes and chunks hold, packed, what is there: entries that were never written, or forgotten, take
/// no memory, however they are spread among others.
///
/// Copy: O(1). Read: O(log n). push_back, mutate, forget: O(log n), and copies a node only if another version
/// shares it.
///
/// Threads. One thread (the writer) changes versions, and publishes some. Others may read a version that was
/// published to them while somebody keeps it alive; they may copy it meanwhile, and destroy their copies when
/// they like. Whether a node is shared is asked of its use count: whoever raises it copies a version that has
/// the node already, so a count of one means that the writer's own version alone has it, which nobody else
/// copies. The count's order (SharedArray) lets the writer change a node only after the reads of those who
/// gave it up.
template <class T, int kBits = 5, int kLeafBits = kBits>
class PersistentVector {
  static_assert(kBits > 0 && kBits <= 5 && kLeafBits >= 0 && kLeafBits <= 5, "a bit each in 32");
  static constexpr std::size_t kWidth = std::size_t{1} << kBits;
  static constexpr std::size_t kLeafWidth = std::size_t{1} << kLeafBits;
  static constexpr std::size_t kLeafMask = kLeafWidth - 1;
  static constexpr int kMaxHeight = 64 / kBits + 1;
  /// A node: those of its places that are taken, packed in their order.
  struct Node {
    SharedArray entries;        ///< of Node, or T in a leaf
    std::uint32_t present = 0;  ///< bit n: place n is taken
  };

 public:
  static constexpr std::size_t kChunk = kLeafWidth;

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }

  /// i < size().
  [[nodiscard]] const T& operator[](std::size_t i) const {
    const T* value = find(i);
    return value ? *value : forgotten();
  }

  /// Reference for writing to entry i < size(); valid until this vector is changed otherwise, or copied.
  [[nodiscard]] T& mutate(std::size_t i) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    Node* node = &root_;
    for (int level = height_; level > 0; --level) node = &own<Node>(*node, place_at(level, i));
    return own<T>(*node, i & kLeafMask);
  }

  /// Entry i < size() reads as T{} until it is written again. Other versions keep theirs.
  void forget(std::size_t i) {
    TWOFOLD_CHECK(i < size_, "index beyond the vector's end");
    if (!find(i)) return;
    std::array<Node*, kMaxHeight + 1> path;  // by level
    path[static_cast<std::size_t>(height_)] = &root_;
    for (int level = height_; level > 0; --level) {
      const auto at = static_cast<std::size_t>(level);
      path[at - 1] = &own<Node>(*path[at], place_at(level, i));
    }
    leave_out<T>(*path[0], i & kLeafMask);
    for (int level = 1; level <= height_; ++level) {
      const auto at = static_cast<std::size_t>(level);
      if (path[at - 1]->present != 0) break;
      leave_out<Node>(*path[at], place_at(level, i));
    }
  }

  void push_back(T value) {
    extend(size_ + 1);
    mutate(size_ - 1) = std::move(value);
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
  /// Which place of a node at `level` >= 1 (leaves are at 0) leads to entry i.
  [[nodiscard]] static std::size_t place_at(int level, std::size_t i) {
    return (i >> (kLeafBits + kBits * (level - 1))) & (kWidth - 1);
  }
  [[nodiscard]] std::size_t capacity() const { return kLeafWidth << (kBits * height_); }

  void grow() {
    Node above;
    if (root_.present != 0) own<Node>(above, 0) = std::move(root_);
    root_ = std::move(above);
    ++height_;
  }

  /// nullptr if entry i takes no memory.
  [[nodiscard]] const T* find(std::size_t i) const {
    const Node* node = &root_;
    for (int level = height_; level > 0; --level) {
      node = entry<Node>(*node, place_at(level, i));
      if (!node) return nullptr;
    }
    return entry<T>(*node, i & kLeafMask);
  }

  /// What is in a node's place: a Node, or a T in a leaf; nullptr if it is not taken.
  template <class E>
  [[nodiscard]] static E* entry(const Node& node, std::size_t place) {
    const std::uint32_t bit = std::uint32_t{1} << place;
    if ((node.present & bit) == 0) return nullptr;
    return node.entries.template data<E>() + std::popcount(node.present & (bit - 1));
  }

  /// The same for writing: takes the place if need be.
  template <class E>
  [[nodiscard]] static E& own(Node& node, std::size_t place) {
    const std::uint32_t present = node.present | std::uint32_t{1} << place;
    if (present != node.present || node.entries.shared()) repack<E>(node, present);
    return *entry<E>(node, place);
  }
  template <class E>
  static void leave_out(Node& node, std::size_t place) {
    repack<E>(node, node.present & ~(std::uint32_t{1} << place));
  }

  /// Gives the node an array of its own, with room for exactly the places in `present`.
  template <class E>
  static void repack(Node& node, std::uint32_t present) {
    Node packed;
    packed.present = present;
    if (present != 0) {
      packed.entries = SharedArray::make<E>(static_cast<std::size_t>(std::popcount(present)));
      const bool shared = node.entries.shared();
      E* to = packed.entries.template data<E>();
      for (std::uint32_t rest = present; rest != 0; rest &= rest - 1, ++to) {
        E* from = entry<E>(node, static_cast<std::size_t>(std::countr_zero(rest)));
        if (!from) continue;
        if (shared) {
          *to = *from;
        } else {
          *to = std::move(*from);
        }
      }
    }
    node = std::move(packed);
  }

  Node root_;
  std::size_t size_ = 0;
  int height_ = 0;  ///< levels of inner nodes
};

}  // namespace twofold
