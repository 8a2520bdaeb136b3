// What one camera does otherwise, it starts when its motion shows depth, and what all do where none is
// measured: points ripen before they are used.
#include "geometry/inverse_depth.hpp"
#include "imaging/guided_search.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

/// An earlier frame becomes the first keyframe of a map or map part, at identity, and this frame is tracked
/// against it.
/// @return kNone, or what the start waits for: the result is then as it was
LostCause Tracker::start_from_motion(FrameStep& step) {
  const auto start = monocular_start_->step(current_, step.frame);
  if (!start) return start.error();
  if (const LostCause cause = confirm_start(*start, step); cause != LostCause::kNone) return cause;
  step.earlier_frames = monocular_start_->earlier_frames(*start);
  const StartCandidate& first = *start->first;
  const Placement here{step.result.reference, step.result.T_c_ref};
  proposer_.begin({kNoKeyframe, SE3()}, {median_depth(SE3()), occupied_regions(rig_.camera, search_)}, step,
                  immature_points_);
  KeyframeProposal& proposal = *step.free_proposal;
  proposal.frame_index = first.frame_index;
  proposal.t_ns = first.t_ns;
  proposal.images.copy_from(first.images);
  // As if the camera had moved evenly since: that is the next frame's prediction.
  const double share = static_cast<double>(first.age - 1) / first.age;
  const auto since_first = static_cast<double>(step.frame.t_ns - first.t_ns);
  motion_.place({here.reference, SE3::exp(share * here.T_c_ref.log())},
                first.t_ns + static_cast<std::int64_t>(share * since_first));
  if (first.wide) {  // most of its points leave the view before a keyframe has brought others
    new_points_.start_seeds_between(first.images, here.reference, immature_points_);
    observe_seeds(step);
  }
  return LostCause::kNone;
}

/// A start counts when the tracker's own search finds its points from where it says the camera is.
/// @return kNone, or why it does not: the step is then as it was, and its points are forgotten
LostCause Tracker::confirm_start(const MonocularStartResult& start, FrameStep& step) {
  const Attempt before = step.attempt();
  const KeyframeId id = proposer_.next();
  immature_points_.clear_points();
  new_points_.forget_seeds();
  for (std::size_t n = 0; n < start.structure.corners.size(); ++n) {
    if (!immature_points_.add(point_of_start(start, n, id))) break;
  }
  const Placement placement{id, start.structure.T_last_first};
  collect_local_map(id, step);
  step.velocity = monocular_start_->velocity(start);
  step.shutter = step.velocity ? shutter_.at(placement.T_c_ref, step) : RollingShutter();
  local_map_search_.run(current_, placement.T_c_ref, options_.local_map.lost_radius_px, step, search_);
  const LostCause cause = pose_estimator_.estimate(placement, step, search_);
  if (cause != LostCause::kNone) {
    step.restore(before);
    immature_points_.clear_points();
    return cause;
  }
  step.result.cause = LostCause::kNone;
  return LostCause::kNone;
}

/// The n-th point of a start, anchored in its first frame: as deep as measured there, or as motion showed.
ImmaturePoint Tracker::point_of_start(const MonocularStartResult& start, std::size_t n, KeyframeId id) const {
  const StartCandidate& first = *start.first;
  const auto corner = static_cast<std::size_t>(start.structure.corners[n]);
  ImmaturePoint point;
  point.anchor = point.usable_since = id;
  point.psi = start.structure.psi[n];
  point.appearance = first.corners[corner].appearance;
  const Vector2 uv = monocular_start_->first_place(first, corner);
  const double u_r = right_of_corner(first.images, rig_, uv, point.appearance.level, options_.search);
  if (has_right(u_r)) point.psi.z() = 1 / rig_.depth_from_disparity(uv.x() - u_r);
  point.anchor_observation.pixel = StereoPixel(uv.x(), uv.y(), u_r).cast<float>();
  point.anchor_observation.level = point.appearance.level;
  return point;
}

/// Few points of known depth are found, and the camera hardly moves: corners without depth say how it turns.
bool Tracker::needs_rays(const TrackResult& result) {
  if (rig_.kind != SensorKind::kMono || result.reference != motion_.reference()) return false;
  if (pose_estimator_.inliers_with_depth(search_) >= options_.new_points.rays_below) return false;
  const double way = (result.T_c_ref * motion_.T_c_ref().inverse()).translation().norm();
  return way < options_.new_points.rays_within * median_depth(result.T_c_ref);
}

/// The depths of corners that wait for one, by what this frame saw of them.
void Tracker::observe_seeds(const FrameStep& step) {
  const TrackResult& result = step.result;
  const auto T_c_anchor = [&](KeyframeId anchor) {
    return result.T_c_ref * pose_relative_to(step.graph, immature_points_, result.reference, anchor);
  };
  // A frame placed by its depth image may have no point that says how far the scene is.
  const double depth = result.by_depth ? depth_alignment_->typical_depth() : median_depth(result.T_c_ref);
  if (depth > 0) new_points_.observe_seeds(current_.left, step.shutter, depth, T_c_anchor, immature_points_);
}

}  // namespace twofold
