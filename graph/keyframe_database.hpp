#pragma once

#include <cstdint>
#include <memory>

#include "graph/ids.hpp"
#include "graph/persistent_vector.hpp"
#include "graph/place_appearance.hpp"

namespace twofold {

/// How the places of a map's keyframes look, by keyframe; a keyframe may have none. A value: copying is O(1),
/// versions share what did not change.
///
/// Threads: as PersistentVector has it. One thread (the loop closer's) copies, changes and destroys versions;
/// others read versions that were published to them.
class KeyframeDatabase {
 public:
  /// Grows with every change; 1 for an empty book.
  [[nodiscard]] std::uint64_t version() const { return version_; }
  /// Keyframes from this number on have no place.
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
  /// Of a keyframe that was culled; id must be less than size().
  void forget(KeyframeId id) {
    places_.forget(index(id));
    ++version_;
  }

 private:
  std::uint64_t version_ = 1;
  PersistentVector<std::shared_ptr<const PlaceAppearance>> places_;
};

}  // namespace twofold
