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
      .above("max_rms", max_rms, 0)
      .share("doubted_rms_share", doubted_rms_share)
      .above("light_change", light_change, 1)
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

std::string LocalMapSearchOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_searches", max_searches, 1)
      .within("wanted_matches", wanted_matches, 1, max_searches)
      .at_least("neighbour_keyframes", neighbour_keyframes, 1)
      .at_least("border_px", border_px, 0)
      .within("min_view_cosine", min_view_cosine, -1, 1)
      .above("lost_radius_px", lost_radius_px, 0)
      .share("light_missed_share", light_missed_share)
      .at_least("min_light_points", min_light_points, 1)
      .above("light_change", light_change, 1)
      .reason();
}

std::string EffortBoundsOptions::invalid_reason() const {
  return OptionCheck()
      .share("points_share", points_share)
      .at_least("coarse_levels", coarse_levels, 0)
      .share("iterations_share", iterations_share)
      .at_least("min_motion_iterations", min_motion_iterations, 1)
      .at_least("min_refine_iterations", min_refine_iterations, 1)
      .reason();
}

std::string TrackerOptions::invalid_reason() const {
  return OptionCheck()
      .nested("effort", effort.invalid_reason())
      .nested("right_rows", right_rows.invalid_reason())
      .nested("fixed", fixed.invalid_reason())
      .nested("motion_model", motion_model.invalid_reason())
      .nested("shutter", shutter.invalid_reason())
      .nested("alignment", alignment.invalid_reason())
      .nested("search", search.invalid_reason())
      .nested("local_map", local_map.invalid_reason())
      .nested("pose", pose.invalid_reason())
      .nested("depth", depth.invalid_reason())
      .nested("loss", loss.invalid_reason())
      .within("loss.recent_keyframes", loss.recent_keyframes, 1, static_cast<double>(DepthAlignment::kViews))
      .nested("monocular_start", monocular_start.invalid_reason())
      .nested("keyframes", keyframes.invalid_reason())
      .nested("reference", reference.invalid_reason())
      .nested("new_points", new_points.invalid_reason())
      .nested("immature", immature.invalid_reason())
      .reason();
}

}  // namespace twofold
