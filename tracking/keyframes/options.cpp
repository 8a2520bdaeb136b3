#include "tracking/keyframes/options.hpp"

#include "base/option_check.hpp"
#include "imaging/image_pyramid.hpp"

namespace twofold {

std::string KeyframeDecisionOptions::invalid_reason() const {
  return OptionCheck()
      .above("parallax", parallax, 0)
      .within("tracked_share", tracked_share, 0, 1)
      .within("emptied_share", emptied_share, 0, 1)
      .above("turn", turn, 0)
      .within("young_map_share", young_map_share, 0, 1)
      .within("urgent_share", urgent_share, 0, tracked_share)
      .at_least("max_pending", max_pending, 1)
      .reason();
}

std::string ReferenceChoiceOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("interval", interval, 1)
      .at_least("min_gain_percent", min_gain_percent, 0)
      .reason();
}

std::string NewPointOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("corner_threshold", corner_threshold, 1)
      .within("corner_levels", corner_levels, 1, ImagePyramid::kLevels)
      .at_least("min_corner_score", min_corner_score, 0)
      .at_least("cell_px", cell_px, 1)
      .at_least("max_points", max_points, 1)
      .at_least("min_start_points", min_start_points, 1)
      .at_least("scarce_points", scarce_points, 0)
      .nested("faint_corners", faint_corners.invalid_reason())
      .above("cells_per_corner", cells_per_corner, 0)
      .above("min_disparity_px", min_disparity_px, 0)
      .at_least("max_row_shift", max_row_shift, 0)
      .at_least("mistake_ratio", mistake_ratio, 1)
      .nested("seeds", seeds.invalid_reason())
      .at_least("seeded_points", seeded_points, 0)
      .reason();
}

std::string ImmaturePointOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_failures", max_failures, 1)
      .at_least("max_age", max_age, 0)
      .within("trusted_after", trusted_after, 0, 255)
      .at_least("moving_after", moving_after, 1)
      .reason();
}

}  // namespace twofold
