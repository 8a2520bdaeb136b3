#include "tracking/options.hpp"

#include "base/option_check.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

std::string DenseAlignmentOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("finest_level", finest_level, 0)
      .within("coarsest_level", coarsest_level, finest_level, ImagePyramid::kLevels - 1)
      .at_least("max_iterations", max_iterations, 1)
      .above("huber_grey", huber_grey, 0)
      .at_least("settled_px", settled_px, 0)
      .reason();
}

std::string WideSearchOptions::invalid_reason() const {
  return OptionCheck()
      .nested("corners", corners.invalid_reason())
      .at_least("max_distance", max_distance, 1)
      .at_least("min_agreeing", min_agreeing, 3)
      .nested("consensus", consensus.invalid_reason())
      .reason();
}

std::string MonocularStartOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("candidates", candidates, 1)
      .at_least("frames_between", frames_between, 2)
      .at_least("longest_path", longest_path, 2)
      .share("placed_share", placed_share)
      .at_least("next_flow", next_flow, 0)
      .share("min_left_share", min_left_share)
      .reason();
}

namespace {

/// What is searched in a frame, and which pose is believed.
void check_search(const TrackerOptions& o, OptionCheck& check) {
  check.at_least("max_searches", o.max_searches, 1)
      .within("wanted_matches", o.wanted_matches, 1, o.max_searches)
      .at_least("neighbour_keyframes", o.neighbour_keyframes, 1)
      .at_least("border_px", o.border_px, 0)
      .within("min_view_cosine", o.min_view_cosine, -1, 1)
      .at_least("min_inliers", o.min_inliers, 3)
      .at_least("scarce_inliers", o.scarce_inliers, 0)
      .at_least("telling_candidates", o.telling_candidates, 0)
      .within("min_inlier_share", o.min_inlier_share, 0, 1)
      .share("light_missed_share", o.light_missed_share)
      .above("light_change", o.light_change, 1)
      .share("doubted_inlier_share", o.doubted_inlier_share)
      .share("doubted_searched_share", o.doubted_searched_share)
      .within("settled_searched_share", o.settled_searched_share, 0, 1)
      .share("rough_inlier_share", o.rough_inlier_share)
      .share("rough_searched_share", o.rough_searched_share)
      .at_least("rough_min_inliers", o.rough_min_inliers, 0)
      .at_least("rough_min_mapped", o.rough_min_mapped, 0)
      .at_least("rough_rounds", o.rough_rounds, 1)
      .share("fixed_inlier_share", o.fixed_inlier_share)
      .within("trusted_after", o.trusted_after, 0, 255)
      .at_least("moving_after", o.moving_after, 1)
      .above("max_alignment_rms", o.max_alignment_rms, 0);
}

/// Where a lost camera is looked for, and when it starts anew.
void check_loss(const TrackerOptions& o, OptionCheck& check) {
  check.above("lost_radius_px", o.lost_radius_px, 0)
      .at_least("coast_for", o.coast_for, 0)
      .above("max_acceleration", o.max_acceleration, 0)
      .above("reach_slack", o.reach_slack, 0)
      .at_least("new_part_after", o.new_part_after, 0)
      .at_least("new_part_frames", o.new_part_frames, 0)
      .at_least("min_corners_seen", o.min_corners_seen, 0)
      .at_least("min_start_points", o.min_start_points, 1)
      .within("recent_keyframes", o.recent_keyframes, 1, static_cast<double>(DepthAlignment::kViews))
      .at_least("depth_patience", o.depth_patience, 0);
}

void check_keyframes_and_points(const TrackerOptions& o, OptionCheck& check) {
  check.above("keyframe_parallax", o.keyframe_parallax, 0)
      .within("keyframe_share", o.keyframe_share, 0, 1)
      .within("keyframe_empty", o.keyframe_empty, 0, 1)
      .above("keyframe_turn", o.keyframe_turn, 0)
      .within("young_map_share", o.young_map_share, 0, 1)
      .within("urgent_share", o.urgent_share, 0, o.keyframe_share)
      .at_least("max_pending", o.max_pending, 1)
      .at_least("corner_threshold", o.corner_threshold, 1)
      .within("corner_levels", o.corner_levels, 1, ImagePyramid::kLevels)
      .at_least("cell_px", o.cell_px, 1)
      .at_least("max_new_points", o.max_new_points, 1)
      .at_least("min_corner_score", o.min_corner_score, 0)
      .at_least("scarce_points", o.scarce_points, 0)
      .at_least("seeded_points", o.seeded_points, 0)
      .at_least("max_failures", o.max_failures, 1)
      .at_least("max_immature_age", o.max_immature_age, 0);
}

}  // namespace

std::string TrackerOptions::invalid_reason() const {
  OptionCheck check;
  check.nested("alignment", alignment.invalid_reason())
      .nested("search", search.invalid_reason())
      .nested("wide_search", wide_search.invalid_reason())
      .nested("elders", elders.invalid_reason())
      .nested("depth", depth.invalid_reason())
      .nested("readout", readout.invalid_reason())
      .nested("fixed", fixed.invalid_reason())
      .nested("motion", motion.invalid_reason());
  check_search(*this, check);
  check_loss(*this, check);
  check_keyframes_and_points(*this, check);
  check.nested("monocular_start", monocular_start.invalid_reason())
      .nested("first_structure", first_structure.invalid_reason())
      .nested("seeds", seeds.invalid_reason());
  return check.reason();
}

}  // namespace twofold
