#include "loopclosure/place_recogniser.hpp"

#include <algorithm>

namespace twofold {
namespace {

/// A keyframe newer than the snapshot is not culled.
bool is_culled(const GraphSnapshot& graph, KeyframeId id) {
  return graph.contains(id) && graph.keyframe(id).culled();
}

}  // namespace

PlaceRecogniser::PlaceRecogniser(std::size_t word_count, const RecogniserOptions& options)
    : options_(options), index_(word_count) {}

std::vector<PlaceCandidate> PlaceRecogniser::recognise(KeyframeId id, const BagOfWords& bag,
                                                       double previous_score, const GraphSnapshot& graph) {
  std::vector<PlaceCandidate> confirmed;
  std::vector<Hypothesis> hypotheses;
  if (previous_score >= options_.min_previous_score) {
    exclude_near(id, graph);
    const auto admitted = [&](KeyframeId k) { return !excluded_.contains(index(k)) && !is_culled(graph, k); };
    for (const PlaceCandidate& candidate :
         index_.query(bag, static_cast<std::size_t>(options_.max_candidates), admitted)) {
      if (candidate.score < options_.min_score * previous_score) break;  // best first
      int length = 1;
      for (const Hypothesis& before : hypotheses_) {
        if (same_place(before.keyframe, candidate.keyframe, graph))
          length = std::max(length, before.length + 1);
      }
      hypotheses.push_back({candidate.keyframe, length});
      if (length >= options_.consistency) confirmed.push_back(candidate);
    }
  }
  hypotheses_ = std::move(hypotheses);
  return confirmed;
}

std::vector<PlaceCandidate> PlaceRecogniser::query_anywhere(const BagOfWords& bag, std::size_t max_count,
                                                            const GraphSnapshot& graph) {
  return index_.query(bag, max_count, [&](KeyframeId k) { return !is_culled(graph, k); });
}

std::vector<PlaceCandidate> PlaceRecogniser::query_other_parts(KeyframeId part, const BagOfWords& bag,
                                                               std::size_t max_count,
                                                               const GraphSnapshot& graph) {
  return index_.query(bag, max_count,
                      [&](KeyframeId k) { return !is_culled(graph, k) && graph.part(k) != part; });
}

std::vector<KeyframeId> PlaceRecogniser::forget_culled(const GraphSnapshot& graph) {
  return index_.forget(static_cast<std::size_t>(options_.culled_visits),
                       [&](KeyframeId k) { return is_culled(graph, k); });
}

void PlaceRecogniser::exclude_near(KeyframeId id, const GraphSnapshot& graph) {
  weighted_breadth_first(graph, id, static_cast<std::size_t>(options_.near_keyframes), excluded_, near_);
}

bool PlaceRecogniser::same_place(KeyframeId a, KeyframeId b, const GraphSnapshot& graph) const {
  const auto distance =
      static_cast<std::int64_t>(twofold::index(a)) - static_cast<std::int64_t>(twofold::index(b));
  if (std::abs(distance) <= options_.same_place) return true;
  return graph.contains(a) && graph.contains(b) && find_edge(graph.keyframe(a), b) != nullptr;
}

}  // namespace twofold
