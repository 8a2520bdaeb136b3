#include "loopclosure/loop_closer.hpp"

#include <stdexcept>

namespace twofold {
namespace {

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
      refinement_(rig, options.refinement),
      probation_(options.probation) {}

void LoopCloser::continue_from(const KeyframeDatabase& places) {
  places_ = places;
  for (std::uint32_t k = 0; k < places.size(); ++k) {
    const PlaceAppearance* place = places.find(KeyframeId{k});
    if (place != nullptr) recogniser_.add(KeyframeId{k}, vocabulary_->bag(place->corners));
  }
}

std::optional<LoopConstraint> LoopCloser::step(const KeyframeProposal& keyframe, const GraphSnapshot& graph) {
  for (const KeyframeId culled : recogniser_.forget_culled(graph)) places_.forget(culled);
  if (!graph.contains(keyframe.id) || graph.keyframe(keyframe.id).culled()) return std::nullopt;
  PlaceView view = describer_.describe(keyframe.images, *vocabulary_);

  // How much this scene's neighbouring views look alike; 0 at the start of a map.
  const double likeness = previous_ ? bag_score(view.bag, *previous_) : 0;
  const auto candidates = recogniser_.recognise(keyframe.id, view.bag, likeness, graph);
  std::optional<LoopConstraint> loop;
  for (const PlaceCandidate& candidate : candidates) {
    const auto verified = verify(candidate.keyframe, view, keyframe.images, graph);
    if (!verified) continue;
    const LoopConstraint seen{graph.version(), candidate.keyframe, keyframe.id, verified->T_c_k,
                              verified->inliers};
    if (probation_.confirms(seen, graph)) loop = seen;
    break;
  }
  remember(keyframe.id, std::move(view));
  return loop;
}

std::optional<Relocalisation> LoopCloser::relocalise(const FrameImages& images, const GraphSnapshot& graph) {
  const PlaceView view = describer_.describe(images, *vocabulary_);
  const auto candidates = recogniser_.query_anywhere(
      view.bag, static_cast<std::size_t>(options_.relocalisation_candidates), graph);
  for (const PlaceCandidate& candidate : candidates) {
    if (auto verified = verify(candidate.keyframe, view, images, graph)) return verified;
  }
  return std::nullopt;
}

std::optional<Relocalisation> LoopCloser::verify(KeyframeId k, const PlaceView& view,
                                                 const FrameImages& images, const GraphSnapshot& graph) {
  if (!graph.contains(k)) return std::nullopt;
  collect_views(k, graph);
  const auto place = verify_place(rig_, views_, view, options_.verification);
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

/// The place's own view and those of its neighbours.
void LoopCloser::collect_views(KeyframeId k, const GraphSnapshot& graph) {
  neighbours_.clear();
  direct_neighbours(graph, k, static_cast<std::size_t>(options_.place_views), neighbours_);
  views_.clear();
  for (const KeyframeId n : neighbours_) {
    const PlaceAppearance* view = places_.find(n);
    if (view == nullptr) continue;
    const SE3 T_n_k = n == k ? SE3() : relative_pose(graph, k, *find_edge(graph.keyframe(k), n));
    views_.push_back({view, T_n_k});
  }
}

void LoopCloser::remember(KeyframeId id, PlaceView view) {
  recogniser_.add(id, view.bag);
  previous_ = std::move(view.bag);
  places_.set(id, std::move(view));
}

}  // namespace twofold
