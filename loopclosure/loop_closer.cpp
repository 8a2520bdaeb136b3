#include "loopclosure/loop_closer.hpp"

#include <stdexcept>

namespace twofold {
namespace {

constexpr std::size_t kCheckedForCulling = 64;  // places a step

LoopCloserOptions validated(const LoopCloserOptions& options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) {
    throw std::runtime_error("loop closer options: " + reason);
  }
  return options;
}

}  // namespace

LoopCloser::LoopCloser(const Rig& rig, std::shared_ptr<const Vocabulary> vocabulary,
                       const LoopCloserOptions& options)
    : rig_(rig),
      vocabulary_(std::move(vocabulary)),
      options_(validated(options)),
      describer_(rig, options.corners),
      recogniser_(vocabulary_->word_count(), options.recogniser),
      refinement_(rig, options.refinement) {}

void LoopCloser::continue_from(const KeyframeDatabase& places) {
  places_ = places;
  bags_.assign(places.size(), {});
  for (std::uint32_t k = 0; k < places.size(); ++k) {
    const PlaceAppearance* place = places.find(KeyframeId{k});
    if (place == nullptr) continue;
    bags_[k] = vocabulary_->bag(place->corners);
    recogniser_.add(KeyframeId{k}, bags_[k]);
  }
}

std::optional<LoopConstraint> LoopCloser::step(const KeyframeProposal& keyframe, const GraphSnapshot& graph) {
  forget_culled(graph);
  if (!graph.contains(keyframe.id) || graph.keyframe(keyframe.id).culled()) return std::nullopt;
  PlaceView view = describer_.describe(keyframe.images, *vocabulary_);

  const double likeness = likeness_with_previous(keyframe.id, view.bag);
  const auto candidates = recogniser_.recognise(keyframe.id, view.bag, likeness, graph);
  std::optional<LoopConstraint> loop;
  for (const PlaceCandidate& candidate : candidates) {
    const auto verified = verify(candidate.keyframe, view, keyframe.images, graph);
    if (!verified) continue;
    loop =
        LoopConstraint{graph.version(), candidate.keyframe, keyframe.id, verified->T_c_k, verified->inliers};
    break;
  }
  remember(keyframe.id, std::move(view));
  return loop;
}

std::optional<Relocalisation> LoopCloser::relocalise(const FrameImages& images, const GraphSnapshot& graph) {
  const PlaceView view = describer_.describe(images, *vocabulary_);
  const auto candidates =
      recogniser_.query_anywhere(view.bag, static_cast<std::size_t>(options_.relocalisation_candidates));
  for (const PlaceCandidate& candidate : candidates) {
    if (auto verified = verify(candidate.keyframe, view, images, graph)) return verified;
  }
  return std::nullopt;
}

std::optional<Relocalisation> LoopCloser::verify(KeyframeId k, const PlaceView& view,
                                                 const FrameImages& images, const GraphSnapshot& graph) {
  if (!graph.contains(k) || graph.keyframe(k).culled()) return std::nullopt;
  const auto place = verify_place(rig_, *places_.find(k), view, options_.verification);
  if (!place) return std::nullopt;
  RefinedPlace refined;
  switch (refinement_.refine(graph, k, images, place->T_b_a, refined)) {
    case RefinementOutcome::kRefined:
      return Relocalisation{k, refined.T_c_k, refined.inliers};
    case RefinementOutcome::kTooFewPoints:
      return Relocalisation{k, place->T_b_a, place->inliers};
    case RefinementOutcome::kContradicted:
      break;
  }
  return std::nullopt;
}

/// How much this scene's neighbouring views look alike; 0 at the start of a map.
double LoopCloser::likeness_with_previous(KeyframeId id, const BagOfWords& bag) const {
  if (previous_ == kNoKeyframe || previous_ >= id || places_.find(previous_) == nullptr) return 0;
  return bag_score(bag, bags_[index(previous_)]);
}

void LoopCloser::remember(KeyframeId id, PlaceView view) {
  recogniser_.add(id, view.bag);
  if (bags_.size() <= index(id)) bags_.resize(index(id) + 1);
  bags_[index(id)] = std::move(view.bag);
  places_.set(id, std::move(view));
  previous_ = id;
}

/// A bounded number of places is looked at each step, so that memory follows the map and no step is long.
void LoopCloser::forget_culled(const GraphSnapshot& graph) {
  for (std::size_t n = 0; n < std::min(kCheckedForCulling, places_.size()); ++n) {
    next_checked_ = next_checked_ + 1 < places_.size() ? next_checked_ + 1 : 0;
    const KeyframeId id{static_cast<std::uint32_t>(next_checked_)};
    if (places_.find(id) == nullptr || id == previous_) continue;
    if (!graph.contains(id) || !graph.keyframe(id).culled()) continue;
    recogniser_.remove(id, bags_[next_checked_]);
    bags_[next_checked_] = {};
    places_.forget(id);
  }
}

}  // namespace twofold
