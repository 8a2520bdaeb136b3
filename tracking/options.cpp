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

std::string TrackerOptions::invalid_reason() const {
  return OptionCheck()
      .nested("alignment", alignment.invalid_reason())
      .nested("search", search.invalid_reason())
      .nested("wide_search", wide_search.invalid_reason())
      .nested("elders", elders.invalid_reason())
      .nested("depth", depth.invalid_reason())
      .nested("motion", motion.invalid_reason())
      .at_least("max_searches", max_searches, 1)
      .within("wanted_matches", wanted_matches, 1, max_searches)
      .at_least("neighbour_keyframes", neighbour_keyframes, 1)
      .at_least("border_px", border_px, 0)
      .within("min_view_cosine", min_view_cosine, -1, 1)
      .at_least("min_inliers", min_inliers, 3)
      .at_least("scarce_inliers", scarce_inliers, 0)
      .at_least("telling_candidates", telling_candidates, 0)
      .within("min_inlier_share", min_inlier_share, 0, 1)
      .share("light_missed_share", light_missed_share)
      .above("light_change", light_change, 1)
      .share("doubted_inlier_share", doubted_inlier_share)
      .share("doubted_searched_share", doubted_searched_share)
      .within("settled_searched_share", settled_searched_share, 0, 1)
      .share("rough_inlier_share", rough_inlier_share)
      .share("rough_searched_share", rough_searched_share)
      .at_least("rough_min_inliers", rough_min_inliers, 0)
      .at_least("rough_min_mapped", rough_min_mapped, 0)
      .within("trusted_after", trusted_after, 0, 255)
      .at_least("moving_after", moving_after, 1)
      .above("lost_radius_px", lost_radius_px, 0)
      .at_least("coast_for", coast_for, 0)
      .above("max_acceleration", max_acceleration, 0)
      .above("reach_slack", reach_slack, 0)
      .at_least("new_part_after", new_part_after, 0)
      .at_least("new_part_frames", new_part_frames, 0)
      .at_least("min_corners_seen", min_corners_seen, 0)
      .above("max_alignment_rms", max_alignment_rms, 0)
      .above("keyframe_parallax", keyframe_parallax, 0)
      .within("keyframe_share", keyframe_share, 0, 1)
      .within("keyframe_empty", keyframe_empty, 0, 1)
      .within("urgent_share", urgent_share, 0, keyframe_share)
      .at_least("max_pending", max_pending, 1)
      .at_least("corner_threshold", corner_threshold, 1)
      .within("corner_levels", corner_levels, 1, ImagePyramid::kLevels)
      .at_least("cell_px", cell_px, 1)
      .at_least("max_new_points", max_new_points, 1)
      .at_least("min_corner_score", min_corner_score, 0)
      .at_least("scarce_points", scarce_points, 0)
      .at_least("seeded_points", seeded_points, 0)
      .at_least("max_failures", max_failures, 1)
      .at_least("max_immature_age", max_immature_age, 0)
      .nested("first_structure", first_structure.invalid_reason())
      .nested("seeds", seeds.invalid_reason())
      .reason();
}

}  // namespace twofold
