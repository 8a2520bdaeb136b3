#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "graph/ids.hpp"

namespace twofold {

/// Scratch map from ids to small numbers: a hash table with linear probing. Its memory is proportional to the
/// most ids it ever held at once, not to the ids' values, which grow for as long as the camera moves. Cleared
/// in O(1) by counting generations.
class IdMap {
 public:
  void clear() {
    count_ = 0;
    if (++generation_ == 0) {  // wrapped around: old marks could be taken for new ones
      entries_.assign(entries_.size(), Entry{});
      generation_ = 1;
    }
  }
  /// Makes room for `count` ids without further allocation.
  void reserve(std::size_t count) {
    std::size_t size = kLeast;
    while (size < 2 * count) size *= 2;
    if (size > entries_.size()) rehash(size);
  }
  /// -1 if there is none.
  [[nodiscard]] int find(std::uint32_t id) const {
    if (entries_.empty()) return -1;
    const Entry& entry = entries_[slot_of(id)];
    return entry.generation == generation_ ? entry.value : -1;
  }
  /// value >= 0.
  void set(std::uint32_t id, int value) {
    if (2 * (count_ + 1) > entries_.size()) reserve(2 * count_ + 1);
    Entry& entry = entries_[slot_of(id)];
    count_ += entry.generation == generation_ ? 0 : 1;
    entry = {generation_, id, value};
  }
  [[nodiscard]] bool contains(KeyframeId id) const { return find(index(id)) >= 0; }
  [[nodiscard]] int find(KeyframeId id) const { return find(index(id)); }
  [[nodiscard]] int find(PointId id) const { return find(index(id)); }
  void set(KeyframeId id, int value) { set(index(id), value); }
  void set(PointId id, int value) { set(index(id), value); }

 private:
  static constexpr std::size_t kLeast = 64;
  struct Entry {
    std::uint32_t generation = 0;
    std::uint32_t id = 0;
    int value = -1;
  };

  /// Where the id is, or where it would go. At least half of the slots are free.
  [[nodiscard]] std::size_t slot_of(std::uint32_t id) const {
    const std::size_t mask = entries_.size() - 1;
    std::size_t slot = (id * std::size_t{2654435761U} >> 7) & mask;
    while (entries_[slot].generation == generation_ && entries_[slot].id != id) slot = (slot + 1) & mask;
    return slot;
  }
  void rehash(std::size_t size) {
    std::vector<Entry> old(size);
    std::swap(old, entries_);
    for (const Entry& entry : old) {
      if (entry.generation == generation_) entries_[slot_of(entry.id)] = entry;
    }
  }

  std::vector<Entry> entries_;  ///< a power of two of them
  std::size_t count_ = 0;
  std::uint32_t generation_ = 1;
};

}  // namespace twofold
