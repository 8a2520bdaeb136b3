#pragma once

#include <vector>

#include "graph/ids.hpp"
#include "graph/neighbourhood.hpp"
#include "loopclosure/vocabulary.hpp"

namespace twofold {

struct PlaceCandidate {
  KeyframeId keyframe = kNoKeyframe;
  double score = 0;  ///< bag_score with the query, in (0, 1]
};

/// Inverted file: for each word the keyframes that have it. Grows with the map; a query costs the words'
/// lists only.
class PlaceIndex {
 public:
  explicit PlaceIndex(std::size_t word_count) : lists_(word_count) {}

  /// Keyframes are added once each; ids need not be in order.
  void add(KeyframeId keyframe, const BagOfWords& bag);
  /// Forgets a keyframe that was culled.
  void remove(KeyframeId keyframe, const BagOfWords& bag);

  /// The `max_count` keyframes most like `bag`, best first, ties to the lower id; those in `excluded` are
  /// left out: topologically close keyframes are the metric loop closure's work (thesis 6.4.2).
  [[nodiscard]] std::vector<PlaceCandidate> query(const BagOfWords& bag, const VisitedSet& excluded,
                                                  std::size_t max_count);

  [[nodiscard]] std::size_t keyframe_count() const { return keyframe_count_; }

 private:
  struct Entry {
    KeyframeId keyframe;
    float weight;
  };

  std::vector<std::vector<Entry>> lists_;
  std::size_t keyframe_count_ = 0;
  std::vector<float> scores_;  // by keyframe; zero between queries
  std::vector<KeyframeId> touched_;
};

}  // namespace twofold
