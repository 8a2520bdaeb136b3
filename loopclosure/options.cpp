#include "base/option_check.hpp"
#include "loopclosure/loop_closer.hpp"

namespace twofold {

std::string RecogniserOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("near_keyframes", near_keyframes, 0)
      .at_least("max_candidates", max_candidates, 1)
      .at_least("min_score", min_score, 0)
      .at_least("min_previous_score", min_previous_score, 0)
      .at_least("consistency", consistency, 1)
      .at_least("same_place", same_place, 0)
      .at_least("culled_visits", culled_visits, 1)
      .reason();
}

std::string VerificationOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_distance", max_distance, 1)
      .above("max_error_px", max_error_px, 0)
      .above("ransac_error_px", ransac_error_px, 0)
      .above("max_stretch", max_stretch, 0)
      .within("max_turn_deg", max_turn_deg, 0, 180)
      .at_least("max_samples", max_samples, 1)
      .at_least("max_iterations", max_iterations, 1)
      .at_least("min_hypothesis", min_hypothesis, 3)
      .above("guided_radius_px", guided_radius_px, 0)
      .at_least("guided_distance", guided_distance, 1)
      .at_least("min_inliers", min_inliers, 4)
      .within("min_inlier_share", min_inlier_share, 0, 1)
      .at_least("min_in_half", min_in_half, 0)
      .at_least("min_disparity_px", min_disparity_px, 0)
      .reason();
}

std::string RefinementOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("neighbours", neighbours, 1)
      .at_least("min_visible", min_visible, 1)
      .at_least("max_points", max_points, min_visible)
      .at_least("border_px", border_px, 0)
      .above("radius_px", radius_px, 0)
      .above("second_radius_px", second_radius_px, 0)
      .at_least("min_inliers", min_inliers, 3)
      .within("min_inlier_share", min_inlier_share, 0, 1)
      .within("min_visible_share", min_visible_share, 0, 1)
      .nested("solver", solver.invalid_reason())
      .reason();
}

std::string DepthRegressionOptions::invalid_reason() const {
  return OptionCheck()
      .share("max_distance_share", max_distance_share)
      .at_least("max_depth_ratio", max_depth_ratio, 1)
      .reason();
}

std::string DriftOptions::invalid_reason() const {
  return OptionCheck()
      .above("placement", placement, 0)
      .above("placement_deg", placement_deg, 0)
      .above("placement_scale", placement_scale, 0)
      .above("shift", shift, 0)
      .above("turn_deg", turn_deg, 0)
      .above("log_scale", log_scale, 0)
      .at_least("length_gain", length_gain, 0)
      .at_least("turn_gain", turn_gain, 0)
      .at_least("turn_gain_of_one_camera", turn_gain_of_one_camera, 0)
      .at_least("log_scale_gain", log_scale_gain, 0)
      .above("step_distance", step_distance, 0)
      .above("step_turn", step_turn, 0)
      .above("max_chi2", max_chi2, 0)
      .reason();
}

std::string ProbationOptions::invalid_reason() const {
  return OptionCheck()
      .above("max_shift", max_shift, 0)
      .above("max_angle_deg", max_angle_deg, 0)
      .above("max_scale", max_scale, 0)
      .nested("drift", drift.invalid_reason())
      .at_least("patience", patience, 1)
      .reason();
}

std::string RedundantLoopOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_way", max_way, 0)
      .at_least("max_keyframes", max_keyframes, 1)
      .at_least("max_shift_px", max_shift_px, 0)
      .at_least("max_log_scale", max_log_scale, 0)
      .reason();
}

std::string LoopCloserOptions::invalid_reason() const {
  return OptionCheck()
      .nested("corners", corners.invalid_reason())
      .nested("recogniser", recogniser.invalid_reason())
      .nested("verification", verification.invalid_reason())
      .nested("refinement", refinement.invalid_reason())
      .nested("probation", probation.invalid_reason())
      .nested("redundant", redundant.invalid_reason())
      .at_least("place_views", place_views, 1)
      .at_least("relocalisation_candidates", relocalisation_candidates, 1)
      .nested("depths", depths.invalid_reason())
      .within("as_mapped_share", as_mapped_share, 0, 1)
      .above("max_sigma", max_sigma, 0)
      .at_least("min_scale_points", min_scale_points, 1)
      .reason();
}

}  // namespace twofold
