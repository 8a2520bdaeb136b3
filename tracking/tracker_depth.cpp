// A depth camera where there are hardly any corners: what it measures says where it is.
#include "tracking/tracker.hpp"

namespace twofold {

/// The keyframes made last whose place relative to the last good frame's reference is known, and the frame.
void Tracker::look_at_surfaces(FrameStep& step) {
  if (step.surfaces_read) return;
  step.surfaces_read = true;
  depth_->look_at(current_.depth);
  depth_->clear_views();
  const KeyframeId part = part_of(step.graph, immature_points_, last_.reference);
  for (std::size_t age = 0; age < recent_views_.size(); ++age) {
    const RecentView& view = recent_views_[age];
    const auto placement = placement_of(step.graph, view.id);
    if (!placement || part_of(step.graph, immature_points_, placement->reference) != part) continue;
    const SE3 T_placed_ref =
        relative_pose(step.graph, immature_points_, placement->reference, last_.reference);
    depth_->add_view(view.id, view.images.depth, placement->T_c_ref * T_placed_ref);
  }
}

SE3 Tracker::predicted_pose() const {
  return (loss_.lost_frames() > 0 ? SE3() : T_cur_prev_) * last_.T_c_ref;
}

/// In place of the alignment to the last frame's points, of which there were too few.
SE3 Tracker::align_to_surfaces(FrameStep& step) {
  look_at_surfaces(step);
  const auto aligned = depth_->align(predicted_pose(), {});
  return aligned ? aligned->T_c_ref : align_to_previous(step);
}

/// After the search for points: few of them say less than they and the surfaces together.
/// @param found  what the search came to
bool Tracker::add_surfaces(const SE3& T_c_ref, LostCause found, FrameStep& step) {
  const bool few =
      found != LostCause::kNone ? corners_scarce_ : step.result.inliers < options_.scarce_inliers;
  if (!depth_ || !few) return false;
  const SE3& start = found == LostCause::kNone ? step.result.T_c_ref : T_c_ref;
  return place_by_surfaces(start, step) == LostCause::kNone;
}

/// Before the frame is given up: what it measures, and no points.
/// @return kNone, or why that is not enough
LostCause Tracker::place_without_points(LostCause found, FrameStep& step) {
  constexpr int kPatience = 5;  // lost frames after which the last good one shows something else
  if (!depth_ || last_.reference == kNoKeyframe || loss_.lost_frames() > kPatience) return found;
  matches_.clear();
  motion_.clear();
  const LostCause open = place_by_surfaces(predicted_pose(), step);
  return open == LostCause::kTooFewMatches ? found : open;
}

/// @return kNone, or why that cannot be: the result is then as it was
LostCause Tracker::place_by_surfaces(const SE3& T_c_ref, FrameStep& step) {
  look_at_surfaces(step);
  const auto placed = depth_->align(T_c_ref, motion_);
  step.lap(TrackerStage::kAlignment);
  if (!placed) return placed.error();
  TrackResult& result = step.result;
  result.status = TrackStatus::kTracking;
  result.by_depth = true;
  result.cause = LostCause::kNone;
  result.reference = last_.reference;
  result.T_c_ref = placed->T_c_ref;
  result.information = placed->information;
  result.matches = static_cast<int>(matches_.size());
  result.inliers = classify_observations(rig_, motion_, result.T_c_ref, options_.motion);
  return LostCause::kNone;
}

}  // namespace twofold
