#include "tracking/search/local_map_search.hpp"

#include <algorithm>
#include <span>

#include "base/median.hpp"
#include "imaging/view_change.hpp"

namespace twofold {
SearchOutcome::SearchOutcome(const Rig& rig, int max_searches)
    : candidates(rig.camera.width, rig.camera.height, LocalMap::kMaxPoints) {
  const auto searches = static_cast<std::size_t>(max_searches);
  matches.reserve(searches);
  missed.reserve(searches);
  observations.reserve(searches);
}

void SearchOutcome::clear() {
  candidates.clear();
  matches.clear();
  missed.clear();
  observations.clear();
  motion = {};
  verdict = {};
}

LocalMapSearch::LocalMapSearch(const Rig& rig, const LocalMapSearchOptions& options,
                               const GuidedSearchOptions& guided, const LocalMap& local_map,
                               const FixedPixels& fixed)
    : rig_(rig), options_(options), guided_(guided), local_map_(local_map), fixed_(fixed) {
  gains_.reserve(static_cast<std::size_t>(options.max_searches));
}

void LocalMapSearch::run(const FrameImages& images, const SE3& T_c_ref, double radius_px, FrameStep& step,
                         SearchOutcome& outcome) {
  TrackResult& result = step.result;
  outcome.clear();
  select_candidates(T_c_ref, result, outcome.candidates);
  step.lap(TrackerStage::kCandidates);
  result.searched = 0;
  result.T_c_ref_predicted = T_c_ref;
  result.search_radius_px = radius_px;
  SearchedView view{images, T_c_ref, step.shutter, guided_};
  view.options.refine_iterations = step.bounds.refine_iterations;
  view.options.radius_px = radius_px;
  for (std::int64_t i = outcome.candidates.next(); i >= 0; i = outcome.candidates.next()) {
    if (static_cast<int>(outcome.matches.size()) >= step.bounds.wanted_matches ||
        result.searched >= step.bounds.max_searches) {
      break;
    }
    ++result.searched;
    const auto point = static_cast<std::uint32_t>(i);
    if (!search_point(point, view, outcome)) outcome.missed.push_back(point);
  }
  search_in_other_light(view, result.searched, outcome);
  result.matches = static_cast<int>(outcome.matches.size());
  step.lap(TrackerStage::kSearch);
}

/// A ray does as long as the camera is so near to where it started that its depth hardly matters.
bool LocalMapSearch::says_where_it_is(const TrackedPoint& point, const Vector3& view_ref) const {
  if (point.ray_sigma == 0) return true;
  const double way = (local_map_.T_ref_a(point).translation() - view_ref).norm();
  return way * point.ray_sigma * rig_.camera.fx < options_.max_ray_px &&
         way * point.psi.z() < options_.max_ray_parallax;
}

void LocalMapSearch::select_candidates(const SE3& T_c_ref, TrackResult& result, Quadtree& candidates) const {
  std::size_t reference_points_in_view = 0;
  const SimilarView view(rig_.camera, T_c_ref,
                         {.border_px = options_.border_px, .min_cosine = options_.min_view_cosine});
  const Vector3 view_ref = T_c_ref.inverse().translation();
  const auto points = local_map_.points();
  const auto [reference_begin, reference_end] = local_map_.reference_range();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto uv = view.find(points[i].x_ref, local_map_.T_ref_a(points[i]).translation());
    if (!uv || fixed_.covers(*uv) || !says_where_it_is(points[i], view_ref)) continue;
    if (i >= reference_begin && i < reference_end) ++reference_points_in_view;
    candidates.insert(uv->cast<float>(), static_cast<std::uint32_t>(i));
  }
  result.candidates = static_cast<int>(candidates.size());
  const auto reference_points = static_cast<double>(reference_end - reference_begin);
  result.reference_in_view =
      reference_points > 0 ? static_cast<double>(reference_points_in_view) / reference_points : 0.0;
}

/// @param point  position in the local map's points
bool LocalMapSearch::search_point(std::uint32_t point, const SearchedView& view,
                                  SearchOutcome& outcome) const {
  const TrackedPoint& tracked = local_map_.points()[point];
  const SE3 T_c_a = view.shutter.seen_from(rig_, view.T_c_ref, tracked.x_ref) * local_map_.T_ref_a(tracked);
  const auto found = find_point(view.images, rig_, *tracked.appearance, tracked.psi, T_c_a, view.options);
  if (found) outcome.matches.push_back({point, *found});
  return found.has_value();
}

/// Where many points were missed and the view is brighter or darker there than their patches are, the light
/// has changed, and they are looked for as they look in it. Patches are not made as bright as the view one by
/// one: before another surface than theirs that would make them look alike.
void LocalMapSearch::search_in_other_light(SearchedView& view, int searched, SearchOutcome& outcome) {
  if (static_cast<double>(outcome.missed.size()) < options_.light_missed_share * searched) return;
  gains_.clear();
  for (const std::uint32_t i : outcome.missed) {
    const TrackedPoint& point = local_map_.points()[i];
    const SE3 T_c_a = view.T_c_ref * local_map_.T_ref_a(point);
    const auto ratio =
        brightness_since_anchor(view.images.left, rig_.camera, *point.appearance, point.psi, T_c_a);
    if (ratio) gains_.push_back(*ratio);
  }
  if (static_cast<int>(gains_.size()) < options_.min_light_points) return;
  const double gain = median(std::span(gains_));
  if (std::max(gain, 1 / gain) < options_.light_change) return;
  view.options.gain = static_cast<float>(gain);
  std::erase_if(outcome.missed, [&](std::uint32_t i) { return search_point(i, view, outcome); });
}

}  // namespace twofold
