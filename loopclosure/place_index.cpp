#include "loopclosure/place_index.hpp"

#include <algorithm>

namespace twofold {

void PlaceIndex::add(KeyframeId keyframe, const BagOfWords& bag) {
  for (const auto& [word, weight] : bag) lists_[word].push_back({keyframe, weight});
  if (scores_.size() <= index(keyframe)) scores_.resize(index(keyframe) + 1, 0.0F);
  ++keyframe_count_;
}

void PlaceIndex::remove(KeyframeId keyframe, const BagOfWords& bag) {
  for (const auto& [word, weight] : bag) {
    std::erase_if(lists_[word], [&](const Entry& entry) { return entry.keyframe == keyframe; });
  }
  --keyframe_count_;
}

std::vector<PlaceCandidate> PlaceIndex::query(const BagOfWords& bag, const VisitedSet& excluded,
                                              std::size_t max_count) {
  touched_.clear();
  for (const auto& [word, weight] : bag) {
    for (const Entry& entry : lists_[word]) {
      float& score = scores_[index(entry.keyframe)];
      if (score == 0) touched_.push_back(entry.keyframe);
      score += std::min(weight, entry.weight);
    }
  }
  std::vector<PlaceCandidate> candidates;
  for (const KeyframeId keyframe : touched_) {
    float& score = scores_[index(keyframe)];
    if (!excluded.contains(index(keyframe))) candidates.push_back({keyframe, score});
    score = 0;
  }
  const auto better = [](const PlaceCandidate& a, const PlaceCandidate& b) {
    return a.score != b.score ? a.score > b.score : a.keyframe < b.keyframe;
  };
  const std::size_t count = std::min(max_count, candidates.size());
  std::partial_sort(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(count),
                    candidates.end(), better);
  candidates.resize(count);
  return candidates;
}

}  // namespace twofold
