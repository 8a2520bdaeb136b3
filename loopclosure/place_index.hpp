#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "graph/ids.hpp"
#include "loopclosure/vocabulary.hpp"

namespace twofold {

struct PlaceCandidate {
  KeyframeId keyframe = kNoKeyframe;
  double score = 0;  ///< bag_score with the query, in (0, 1]
};

/// Inverted file: for each word the keyframes that have it. Memory follows the keyframes that are in it, not
/// their ids, which grow for as long as the camera moves; a query costs the words' lists only.
class PlaceIndex {
 public:
  using Predicate = std::function<bool(KeyframeId)>;

  explicit PlaceIndex(std::size_t word_count) : lists_(word_count) {}

  /// A keyframe that is not in the index; ids need not be in order.
  void add(KeyframeId keyframe, BagOfWords bag);
  /// Forgets the keyframes that are `gone` among the next `visits` of the index, in turn: called once for
  /// every keyframe added, it leaves at most one in `visits` of those that are gone in the index.
  /// @return  the keyframes forgotten
  std::vector<KeyframeId> forget(std::size_t visits, const Predicate& gone);

  /// The `max_count` keyframes most like `bag` that are `admitted`, best first, ties to the lower id. Asks
  /// about those only that would be among the best.
  [[nodiscard]] std::vector<PlaceCandidate> query(const BagOfWords& bag, std::size_t max_count,
                                                  const Predicate& admitted);

  [[nodiscard]] std::size_t keyframe_count() const { return slots_.size() - free_.size(); }

 private:
  using Slot = std::uint32_t;
  struct Entry {
    Slot slot;
    float weight;
  };
  struct Place {
    KeyframeId keyframe = kNoKeyframe;  ///< kNoKeyframe: the slot is free
    BagOfWords bag;
    float score = 0;  ///< with a query; zero between queries
  };

  void remove(Slot slot);

  std::vector<std::vector<Entry>> lists_;  ///< by word
  std::vector<Place> slots_;
  std::vector<Slot> free_;
  std::size_t next_visited_ = 0;
  std::vector<Slot> touched_;
};

}  // namespace twofold
