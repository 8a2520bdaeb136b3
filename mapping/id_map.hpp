#pragma once

#include <cstdint>
#include <vector>

#include "graph/ids.hpp"

namespace twofold {

/// Scratch map from dense ids to small numbers. Grows to the largest id seen; cleared in O(1) by counting
/// rounds, so that its cost follows what is in it and not the size of the map.
class IdMap {
 public:
  void clear() {
    if (++round_ == 0) {  // wrapped around: old marks could be taken for new ones
      entries_.clear();
      round_ = 1;
    }
  }
  /// -1 if there is none.
  [[nodiscard]] int find(std::uint32_t id) const {
    return id < entries_.size() && entries_[id].round == round_ ? entries_[id].value : -1;
  }
  void set(std::uint32_t id, int value) {
    if (id >= entries_.size()) entries_.resize(id + 1);
    entries_[id] = {round_, value};
  }
  [[nodiscard]] bool contains(KeyframeId id) const { return find(index(id)) >= 0; }
  [[nodiscard]] int find(KeyframeId id) const { return find(index(id)); }
  [[nodiscard]] int find(PointId id) const { return find(index(id)); }
  void set(KeyframeId id, int value) { set(index(id), value); }
  void set(PointId id, int value) { set(index(id), value); }

 private:
  struct Entry {
    std::uint32_t round = 0;
    int value = -1;
  };
  std::vector<Entry> entries_;
  std::uint32_t round_ = 1;
};

}  // namespace twofold
