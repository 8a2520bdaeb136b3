#include "loopclosure/place_index.hpp"

#include <algorithm>

namespace twofold {

void PlaceIndex::add(KeyframeId keyframe, BagOfWords bag) {
  if (free_.empty()) {
    free_.push_back(static_cast<Slot>(slots_.size()));
    slots_.emplace_back();
  }
  const Slot slot = free_.back();
  free_.pop_back();
  for (const auto& [word, weight] : bag) lists_[word].push_back({slot, weight});
  slots_[slot] = {keyframe, std::move(bag)};
}

std::vector<KeyframeId> PlaceIndex::forget(std::size_t visits, const Predicate& gone) {
  std::vector<KeyframeId> forgotten;
  for (std::size_t n = std::min(visits, slots_.size()); n > 0; --n) {
    if (next_visited_ >= slots_.size()) next_visited_ = 0;
    const auto slot = static_cast<Slot>(next_visited_++);
    const KeyframeId keyframe = slots_[slot].keyframe;
    if (keyframe == kNoKeyframe || !gone(keyframe)) continue;
    remove(slot);
    forgotten.push_back(keyframe);
  }
  return forgotten;
}

void PlaceIndex::remove(Slot slot) {
  for (const auto& [word, weight] : slots_[slot].bag) {
    std::erase_if(lists_[word], [&](const Entry& entry) { return entry.slot == slot; });
  }
  slots_[slot] = {};
  free_.push_back(slot);
}

std::vector<PlaceCandidate> PlaceIndex::query(const BagOfWords& bag, std::size_t max_count,
                                              const Predicate& admitted) {
  touched_.clear();
  for (const auto& [word, weight] : bag) {
    for (const Entry& entry : lists_[word]) {
      float& score = slots_[entry.slot].score;
      if (score == 0) touched_.push_back(entry.slot);
      score += std::min(weight, entry.weight);
    }
  }
  std::vector<PlaceCandidate> heap;
  heap.reserve(touched_.size());
  for (const Slot slot : touched_) {
    heap.push_back({slots_[slot].keyframe, slots_[slot].score});
    slots_[slot].score = 0;
  }
  const auto worse = [](const PlaceCandidate& a, const PlaceCandidate& b) {
    return a.score != b.score ? a.score < b.score : a.keyframe > b.keyframe;
  };
  std::make_heap(heap.begin(), heap.end(), worse);
  std::vector<PlaceCandidate> best;
  while (!heap.empty() && best.size() < max_count) {
    std::pop_heap(heap.begin(), heap.end(), worse);
    if (admitted(heap.back().keyframe)) best.push_back(heap.back());
    heap.pop_back();
  }
  return best;
}

}  // namespace twofold
