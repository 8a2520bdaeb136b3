#pragma once

#include <cstdint>
#include <memory>

#include "graph/ids.hpp"
#include "graph/persistent_vector.hpp"
#include "graph/place_appearance.hpp"

namespace twofold {

/// What recognition remembers of the keyframes of a map; of some it may remember nothing. A value: copying is
/// O(1), and versions share what did not change.
///
/// Threads: the rules of PersistentVector. One thread, the loop closer's, changes versions; others read, copy
/// and destroy those that it gives them.
class KeyframeDatabase {
 public:
  /// Grows with every change; 1 for an empty database.
  [[nodiscard]] std::uint64_t version() const { return version_; }
  /// Greater than the number of every keyframe in it.
  [[nodiscard]] std::size_t size() const { return places_.size(); }
  /// Null: the keyframe was never described, or is forgotten.
  [[nodiscard]] const PlaceAppearance* find(KeyframeId id) const {
    return index(id) < places_.size() ? places_[index(id)].get() : nullptr;
  }

  void set(KeyframeId id, PlaceAppearance place) {
    places_.extend(std::size_t{index(id)} + 1);
    places_.mutate(index(id)) = std::make_shared<const PlaceAppearance>(std::move(place));
    ++version_;
  }
  /// Forgets a keyframe that was culled; id must be less than size().
  void forget(KeyframeId id) {
    places_.forget(index(id));
    ++version_;
  }

 private:
  std::uint64_t version_ = 1;
  PersistentVector<std::shared_ptr<const PlaceAppearance>> places_;
};

}  // namespace twofold
