#pragma once

#include <string>
#include <vector>

#include "graph/neighbourhood.hpp"
#include "graph/snapshot.hpp"
#include "loopclosure/place_index.hpp"

namespace twofold {

struct RecogniserOptions {
  int near_keyframes = 60;  ///< this many around the query, breadth-first, are never candidates, >= 0
  int max_candidates = 10;  ///< of a query, >= 1
  double min_score = 0.4;   ///< of a candidate, relative to the score with the keyframe before, >= 0
  double min_previous_score =
      0.05;             ///< score with the keyframe before below which the query says nothing, >= 0
  int consistency = 2;  ///< successive keyframes that must agree about the place, >= 1
  int same_place =
      6;  ///< keyframes whose numbers differ by no more, or that an edge joins, show the same place, >= 0
  /// Places looked at for each one added, in turn, whether their keyframe was culled: bounds a step's time;
  /// at most one place in so many is of a culled keyframe. >= 1
  int culled_visits = 64;

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Hypotheses of places seen before, by appearance and topology  (thesis 6.4.2).
///
/// A candidate must be topologically distant (near places are the metric loop closure's work), look as much
/// like the query as `min_score` of what two neighbouring keyframes look alike, which takes the scene's own
/// texture out of the threshold, and be confirmed by the keyframes before, which must have had a candidate at
/// the same place.
class PlaceRecogniser {
 public:
  PlaceRecogniser(std::size_t word_count, const RecogniserOptions& options);

  /// Adds a keyframe to the index.
  void add(KeyframeId id, BagOfWords bag) { index_.add(id, std::move(bag)); }
  /// Takes some of the keyframes that `graph` has culled out of the index, and says which.
  std::vector<KeyframeId> forget_culled(const GraphSnapshot& graph);
  [[nodiscard]] std::size_t keyframe_count() const { return index_.keyframe_count(); }

  /// Candidates for the keyframe `id`, which `graph` has and the index need not, best first. To be called for
  /// keyframes in the order they were made: the calls before are what a candidate must be consistent with.
  /// @param previous_score  bag_score with the keyframe before; scores are relative to it
  [[nodiscard]] std::vector<PlaceCandidate> recognise(KeyframeId id, const BagOfWords& bag,
                                                      double previous_score, const GraphSnapshot& graph);

  /// Candidates anywhere in the map, best first, without the tests that need a history: for a lost camera.
  /// Here as there, a culled keyframe is no candidate.
  [[nodiscard]] std::vector<PlaceCandidate> query_anywhere(const BagOfWords& bag, std::size_t max_count,
                                                           const GraphSnapshot& graph);
  /// The same in the map's other parts: who is in a part of its own was lost, and may be where another one
  /// knows its way.
  [[nodiscard]] std::vector<PlaceCandidate> query_other_parts(KeyframeId part, const BagOfWords& bag,
                                                              std::size_t max_count,
                                                              const GraphSnapshot& graph);

 private:
  /// A place that the last queries agreed about.
  struct Hypothesis {
    KeyframeId keyframe;
    int length;  ///< successive queries that had it
  };

  void exclude_near(KeyframeId id, const GraphSnapshot& graph);
  [[nodiscard]] bool same_place(KeyframeId a, KeyframeId b, const GraphSnapshot& graph) const;

  RecogniserOptions options_;
  PlaceIndex index_;
  VisitedSet excluded_;
  std::vector<TreeNode> near_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace twofold
