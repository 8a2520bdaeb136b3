#include "loopclosure/loop_closer.hpp"

#include <algorithm>
#include <span>
#include <stdexcept>
#include <utility>

#include "base/median.hpp"

namespace twofold {
namespace {

LoopCloserOptions validated(const LoopCloserOptions& options) {
  if (const std::string reason = options.invalid_reason(); !reason.empty()) {
    throw std::runtime_error("loop closer options: " + reason);
  }
  return options;
}

constexpr double kSamePlace = 3;  // standard deviations

/// With one camera, depths are written as if there was a second one at the map's unit of length.
Rig with_baseline(Rig rig) {
  if (rig.kind == SensorKind::kMono) rig.baseline = 1;
  return rig;
}

}  // namespace

LoopCloser::LoopCloser(const Rig& rig, std::shared_ptr<const Vocabulary> vocabulary,
                       const LoopCloserOptions& options)
    : rig_(with_baseline(rig)),
      vocabulary_(std::move(vocabulary)),
      options_(validated(options)),
      describer_(rig, options.corners),
      recogniser_(vocabulary_->word_count(), options.recogniser),
      refinement_(rig, options.refinement),
      probation_(rig.kind, options.probation),
      redundant_(rig.camera, options.redundant),
      depths_(rig.camera, options.depths),
      place_depths_(rig.camera, options.depths) {}

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
  DescribedPlace view = describer_.describe(keyframe.images, *vocabulary_);

  const bool one_camera = rig_.kind == SensorKind::kMono;
  if (one_camera) {
    depths_.learn(graph, keyframe.id);
    depths_.fill(view, rig_.baseline);
  }
  // How much this scene's neighbouring views look alike; 0 at the start of a map.
  const double likeness = previous_ ? bag_score(view.bag, *previous_) : 0;
  const auto consistent = recogniser_.recognise(keyframe.id, view.bag, likeness, graph);
  const auto place = consistent.empty() ? only_place(in_older_parts(keyframe.id, view.bag, graph), view,
                                                     keyframe.images, graph)
                                        : first_place(consistent, keyframe.id, view, keyframe.images, graph);
  std::optional<LoopConstraint> loop;
  if (const auto scale = place ? scale_of(*place) : std::nullopt) {
    const SE3 T_to_from(place->T_c_k.so3(), *scale * place->T_c_k.translation());
    const LoopConstraint seen{graph.version(), place->keyframe, keyframe.id, T_to_from,
                              place->inliers,  place->weight,   *scale};
    if (!is_exact(seen, *scale * place->sigma, graph))
      probation_.hold(seen);
    else if (probation_.confirms(seen, graph) &&
             !(one_camera && redundant_.has(seen, refinement_.found(), graph)))
      loop = seen;
  }
  if (one_camera) view.pixels.clear();  // the map may change
  remember(keyframe.id, std::move(view));
  return loop;
}

/// A keyframe of a part that was begun after a loss is looked for as a lost camera is: it has few keyframes
/// before it to be consistent with, and the same place may look much alike here and there only once.
std::vector<PlaceCandidate> LoopCloser::in_older_parts(KeyframeId id, const BagOfWords& bag,
                                                       const GraphSnapshot& graph) {
  while (graph.keyframe(KeyframeId{oldest_}).culled()) ++oldest_;  // ends at `id` at the latest
  const KeyframeId part = graph.part(id);
  if (graph.keyframe(KeyframeId{oldest_}).part == part) return {};
  return recogniser_.query_other_parts(part, bag,
                                       static_cast<std::size_t>(options_.relocalisation_candidates), graph);
}

std::optional<Relocalisation> LoopCloser::relocalise(const FrameImages& images, const GraphSnapshot& graph) {
  DescribedPlace view = describer_.describe(images, *vocabulary_);
  if (rig_.kind == SensorKind::kMono) {
    for (const DescribedCorner& corner : view.corners)
      view.pixels.emplace_back(corner.uv.x(), corner.uv.y(), static_cast<float>(Rig::kNoRight));
  }
  return only_place(recogniser_.query_anywhere(
                        view.bag, static_cast<std::size_t>(options_.relocalisation_candidates), graph),
                    view, images, graph);
}

/// Whether a loop knows better than the map does where the keyframe is. Within a part the map does but for
/// drift, and a rough pose would put error in instead of taking drift out.
bool LoopCloser::is_exact(const LoopConstraint& loop, double sigma, const GraphSnapshot& graph) const {
  return graph.part(loop.to) != graph.part(loop.from) ||
         sigma <= options_.max_sigma * graph.keyframe(loop.to).median_depth;
}

/// The likeliest of the candidates that is verified.
std::optional<Relocalisation> LoopCloser::first_place(const std::vector<PlaceCandidate>& candidates,
                                                      KeyframeId id, const DescribedPlace& view,
                                                      const FrameImages& images, const GraphSnapshot& graph) {
  views_with_depth_.clear();
  for (const PlaceCandidate& candidate : candidates) {
    auto verified =
        verify(candidate.keyframe, view, images, graph, pose_in_map(graph, id, candidate.keyframe));
    if (verified && scale_of(*verified)) return verified;
  }
  return std::nullopt;
}

/// The same, where nothing is known of where the camera may be: none if the view shows places that cannot be
/// one, as in a street whose houses look alike.
std::optional<Relocalisation> LoopCloser::only_place(const std::vector<PlaceCandidate>& candidates,
                                                     const DescribedPlace& view, const FrameImages& images,
                                                     const GraphSnapshot& graph) {
  views_with_depth_.clear();
  std::optional<Relocalisation> likeliest;
  for (const PlaceCandidate& candidate : candidates) {
    const auto verified = verify(candidate.keyframe, view, images, graph);
    if (!verified) continue;
    if (!likeliest)
      likeliest = verified;
    else if (probation_.contradicts(likeliest->keyframe, verified->keyframe,
                                    Sim3(likeliest->T_c_k.inverse() * verified->T_c_k), graph))
      return std::nullopt;
  }
  // Once more, so that what the refinement found last is the answer's.
  return likeliest ? verify(likeliest->keyframe, view, images, graph) : std::nullopt;
}

std::optional<Relocalisation> LoopCloser::verify(KeyframeId k, const DescribedPlace& view,
                                                 const FrameImages& images, const GraphSnapshot& graph,
                                                 const std::optional<SE3>& T_mapped) {
  if (!graph.contains(k)) return std::nullopt;
  const PlaceAppearance* own = view_of(k, graph);
  if (own == nullptr) return std::nullopt;
  const auto place = verify_place(
      rig_, *own, [&] { return views_of_place(k, graph); }, view, options_.verification);
  if (!place) return std::nullopt;
  RefinedPlace refined;
  switch (refine(graph, k, images, place->T_b_a, T_mapped, refined)) {
    case RefinementOutcome::kRefined:
      return Relocalisation{k, refined.T_c_k, refined.inliers, refined.weight, refined.sigma};
    case RefinementOutcome::kTooFewPoints:
      if (rig_.kind == SensorKind::kMono) return std::nullopt;
      return Relocalisation{k, place->T_b_a, place->inliers, 1};
    case RefinementOutcome::kContradicted:
      break;
  }
  return std::nullopt;
}

/// From where the corners have the view, and from where the map has it, if that is known. Where both lead to
/// one place, what knows it better is kept. Else corners of a wall far away may have fitted a wrong pose,
/// around which the search found those points alone that fit there: such a pose must explain clearly more of
/// them.
RefinementOutcome LoopCloser::refine(const GraphSnapshot& graph, KeyframeId k, const FrameImages& images,
                                     const SE3& T_c_k, const std::optional<SE3>& T_mapped,
                                     RefinedPlace& result) {
  const RefinementOutcome seen = refinement_.refine(graph, k, images, T_c_k, result);
  if (!T_mapped || seen != RefinementOutcome::kRefined) return seen;
  RefinedPlace as_mapped;
  if (refinement_.refine(graph, k, images, *T_mapped, as_mapped) == RefinementOutcome::kRefined) {
    const double apart = (as_mapped.T_c_k * result.T_c_k.inverse()).translation().norm();
    const bool one_place = apart <= kSamePlace * std::max(as_mapped.sigma, result.sigma);
    if (one_place ? as_mapped.sigma <= result.sigma
                  : as_mapped.inliers >= options_.as_mapped_share * result.inliers) {
      result = as_mapped;
      return seen;
    }
  }
  // Once more, so that what the refinement found last is the answer's.
  return refinement_.refine(graph, k, images, T_c_k, result);
}

/// What lengths around the keyframe at hand measure over what they measure around the place (the inverse
/// ratio of their units): depths that the map gives positions in the image, over those that the points of the
/// place have from here. Their median.
std::optional<double> LoopCloser::scale_of(const Relocalisation& seen) const {
  if (rig_.kind != SensorKind::kMono) return 1.0;
  std::vector<double> ratios;
  for (const MotionObservation& found : refinement_.found()) {
    const auto depth = found.inlier ? depths_.depth_at(found.pixel.head<2>().cast<double>()) : std::nullopt;
    if (depth) ratios.push_back(*depth / (seen.T_c_k * found.x_ref).z());
  }
  if (ratios.size() < static_cast<std::size_t>(options_.min_scale_points)) return std::nullopt;
  return median(std::span(ratios));
}

/// What is remembered of a keyframe, with depths; null if nothing is.
const PlaceAppearance* LoopCloser::view_of(KeyframeId k, const GraphSnapshot& graph) {
  const PlaceAppearance* view = places_.find(k);
  if (view == nullptr || rig_.kind != SensorKind::kMono) return view;
  const auto known = std::find_if(views_with_depth_.begin(), views_with_depth_.end(),
                                  [&](const ViewWithDepth& other) { return other.keyframe == k; });
  if (known != views_with_depth_.end()) return &known->view;
  place_depths_.learn(graph, k);
  PlaceAppearance& with_depth = views_with_depth_.emplace_back(ViewWithDepth{k, *view}).view;
  place_depths_.fill(with_depth, rig_.baseline);
  return &with_depth;
}

/// The place's own view and those of its neighbours.
std::span<const PlacedView> LoopCloser::views_of_place(KeyframeId k, const GraphSnapshot& graph) {
  neighbours_.clear();
  direct_neighbours(graph, k, static_cast<std::size_t>(options_.place_views), neighbours_);
  views_.clear();
  for (const KeyframeId n : neighbours_) {
    const PlaceAppearance* view = view_of(n, graph);
    if (view == nullptr) continue;
    const SE3 T_n_k = n == k ? SE3() : relative_pose(graph, k, *find_edge(graph.keyframe(k), n));
    views_.push_back({view, T_n_k});
  }
  return views_;
}

void LoopCloser::remember(KeyframeId id, DescribedPlace view) {
  recogniser_.add(id, view.bag);
  previous_ = std::move(view.bag);
  places_.set(id, std::move(view));
}

}  // namespace twofold
