#include "tracking/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

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
