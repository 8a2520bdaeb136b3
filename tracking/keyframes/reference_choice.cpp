#include "tracking/keyframes/reference_choice.hpp"

#include <algorithm>

namespace twofold {

std::optional<KeyframeId> ReferenceChoice::better(const GraphSnapshot& graph, KeyframeId reference,
                                                  const LocalMap& local_map, const SearchOutcome& found) {
  if (frames_ % static_cast<std::uint32_t>(options_.interval) != 0) return std::nullopt;
  found_.clear();
  for (std::size_t m = 0; m < found.matches.size(); ++m) {
    const PointId id = local_map.points()[found.matches[m].point].id;
    if (found.observations[m].inlier && id != kNoPoint) found_.push_back(id);
  }
  std::sort(found_.begin(), found_.end());
  std::optional<KeyframeId> best;
  // Changing back and forth helps nobody: a new reference must be clearly better.
  int best_count = static_cast<int>(shared(graph, reference) * (1 + options_.min_gain_share));
  for (const KeyframeId id : local_map.neighbours()) {
    const int count = shared(graph, id);
    if (count <= best_count) continue;
    best = id;
    best_count = count;
  }
  return best;
}

/// How many of the points found the keyframe sees.
int ReferenceChoice::shared(const GraphSnapshot& graph, KeyframeId id) const {
  int count = 0;
  for (const Observation& observation : *graph.keyframe(id).observations) {
    count += std::binary_search(found_.begin(), found_.end(), observation.point) ? 1 : 0;
  }
  return count;
}

}  // namespace twofold
