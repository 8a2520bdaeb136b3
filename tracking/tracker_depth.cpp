// A depth camera where there are hardly any corners: depth alignment says where it is, together with what
// points were found, or alone.
#include <cmath>
#include <utility>

#include "geometry/symmetric_solve.hpp"
#include "tracking/tracker.hpp"

namespace twofold {

/// From shape alone the camera is placed only beside where it was: after some frames the last good one shows
/// something else, and one corner of a room looks like the next.
bool Tracker::depth_can_place(const FrameStep& step) const {
  return depth_alignment_ && motion_.reference() != kNoKeyframe &&
         step.lost_frames <= options_.depth.patience;
}

/// The frame's depth image, once.
void Tracker::read_depth(FrameStep& step) {
  if (!std::exchange(step.depth_read, true)) depth_alignment_->look_at(current_.depth);
}

/// To the keyframes made last whose place relative to the last good frame's reference is known.
tl::expected<DepthAlignment::Result, LostCause> Tracker::align_depth(
    const SE3& T_c_ref, std::span<const MotionObservation> corners, FrameStep& step) {
  read_depth(step);
  depth_alignment_->clear_views();
  for (std::size_t age = 0; age < views_.keyframes().size(); ++age) {
    const RecentView& view = views_.keyframes()[age];
    const auto placement = placement_in_this_part(view.id, step);
    if (!placement) continue;
    const SE3 T_placed_ref =
        pose_relative_to(step.graph, immature_points_, placement->reference, motion_.reference());
    depth_alignment_->add_view(view.id, view.images.depth, placement->T_c_ref * T_placed_ref);
  }
  return depth_alignment_->align(T_c_ref, corners);
}

/// In place of the alignment to the last frame's points, of which there were too few.
SE3 Tracker::align_to_depth(FrameStep& step) {
  const auto aligned = align_depth(motion_.predicted_pose(step.frame.t_ns, step.after_loss()), {}, step);
  return aligned ? aligned->T_c_ref : aligned_pose(step);
}

/// After the search for points: few of them say less than they and depth together.
/// @param found  what the search came to
bool Tracker::place_by_both(const SE3& T_c_ref, LostCause found, FrameStep& step) {
  const bool points_placed = found == LostCause::kNone;
  const bool few = points_placed ? step.result.inliers < options_.depth.scarce_inliers : last_.by_depth;
  if (!few || !depth_can_place(step)) return false;
  const Attempt by_points = step.attempt();
  const bool telling =
      points_placed && (step.after_loss() || pose_estimator_.well_supported(by_points.result, search_));
  if (place_by_depth(points_placed ? by_points.result.T_c_ref : T_c_ref, step) != LostCause::kNone)
    return false;
  const bool agree = step.result.inliers >= options_.depth.agreeing_share * by_points.result.inliers;
  const bool allowed = points_placed ? agree || !telling : may_be_placed(agree, step);
  if (allowed) return true;
  step.depth_refused = true;
  step.restore(by_points);
  classify_observations(rig_, search_.observations, by_points.result.T_c_ref, options_.pose.motion);
  return false;
}

/// Points gave no pose, and depth did: whether they leave it at that. What stands in the camera's way along
/// bare walls may be somebody who walks: depth has the camera go along, points on the floor do not.
/// @param agree  those of which one motion is true agree with it
bool Tracker::may_be_placed(bool agree, FrameStep& step) {
  const TrackResult& result = step.result;
  const bool contradicted = !agree && result.matches >= options_.pose.min_inliers &&
                            result.inliers < options_.pose.min_inlier_share * result.matches;
  return !contradicted && (!step.after_loss() || points_allow(step));
}

/// Before the frame is given up: what it measures, and no points.
/// @return kNone, or why that is not enough
LostCause Tracker::place_by_depth_alone(LostCause found, FrameStep& step) {
  if (!depth_can_place(step) || step.depth_refused) return found;
  search_.clear();
  const LostCause open = place_by_depth(motion_.predicted_pose(step.frame.t_ns, step.after_loss()), step);
  if (open != LostCause::kNone) return open == LostCause::kTooFewMatches ? found : open;
  return points_allow(step) ? LostCause::kNone : found;
}

/// A pose that depth alone gave, from a start that may be far off, before the map's points: they may give a
/// better one. After a loss nobody knows how the camera moves, and where enough of them should be seen and
/// are not found, the pose is wrong.
bool Tracker::points_allow(FrameStep& step) {
  const Attempt by_depth = step.attempt();
  TrackResult& result = step.result;
  result.by_depth = false;
  const Placement placement{result.reference, result.T_c_ref};
  collect_local_map(placement.reference, step);
  const SearchStart start{.placement = placement, .kind = SearchStart::Kind::kRough};
  if (search_from(start, step) == LostCause::kNone) return true;
  if (step.after_loss() && result.candidates >= options_.depth.telling_candidates) return false;
  step.restore(by_depth);
  search_.clear();
  result.matches = result.inliers = 0;
  return true;
}

/// So far from where it would be had it gone on that the two views have nothing in common: a corridor looks
/// the same across, too.
bool Tracker::turns_away(const SE3& T_c_ref, const FrameStep& step) const {
  const SE3 T_c_ref_predicted = motion_.predicted_pose(step.frame.t_ns, step.after_loss());
  const double half_view = std::atan(0.5 * rig_.camera.width / rig_.camera.fx);
  return (T_c_ref.so3() * T_c_ref_predicted.so3().inverse()).log().norm() > half_view;
}

/// By depth and the points found, of which there may be none.
/// @return kNone, or why that cannot be: the result is then as it was
LostCause Tracker::place_by_depth(const SE3& T_c_ref, FrameStep& step) {
  const auto placed = align_depth(T_c_ref, search_.observations, step);
  step.lap(TrackerStage::kAlignment);
  if (!placed) return placed.error();
  if (turns_away(placed->T_c_ref, step)) return LostCause::kTooFewMatches;
  TrackResult& result = step.result;
  result.status = TrackStatus::kTracking;
  result.by_depth = true;
  result.cause = LostCause::kNone;
  result.reference = motion_.reference();
  result.T_c_ref = placed->T_c_ref;
  step.information_of_planes = placed->information;
  result.information =
      inverse_symmetric(placed->covariance + shutter_.covariance(placed->all, placed->by_rows, step));
  result.matches = static_cast<int>(search_.matches.size());
  result.inliers = classify_observations(rig_, search_.observations, result.T_c_ref, options_.pose.motion);
  return LostCause::kNone;
}

/// Whether the frame would be placed relative to itself by its depth alone: kNone, or why not.
LostCause Tracker::judge_structure(FrameStep& step) {
  if (!depth_alignment_) return LostCause::kTooFewMatches;
  read_depth(step);
  return depth_alignment_->judge_structure();
}

/// With few corners in view: whether depth would tell how the camera moves from here on. That the map's
/// points are not found says little then: if depth, too, leaves that open, it is why the camera stays lost.
bool Tracker::sees_structure(FrameStep& step) {
  const LostCause open = judge_structure(step);
  LostCause& cause = step.result.cause;
  const bool unexplained = cause == LostCause::kTooFewCandidates || cause == LostCause::kTooFewMatches;
  if (unexplained && open == LostCause::kNoStructure) cause = open;
  return open == LostCause::kNone;
}

}  // namespace twofold
