#include "tracking/search/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string LocalMapSearchOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_searches", max_searches, 1)
      .within("wanted_matches", wanted_matches, 1, max_searches)
      .at_least("neighbour_keyframes", neighbour_keyframes, 1)
      .at_least("border_px", border_px, 0)
      .within("min_view_cosine", min_view_cosine, -1, 1)
      .above("lost_radius_px", lost_radius_px, 0)
      .above("max_ray_px", max_ray_px, 0)
      .above("max_ray_parallax", max_ray_parallax, 0)
      .share("light_missed_share", light_missed_share)
      .at_least("min_light_points", min_light_points, 1)
      .above("light_change", light_change, 1)
      .reason();
}

std::string NewPointOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("corner_threshold", corner_threshold, 1)
      .within("corner_levels", corner_levels, 1, 3)
      .at_least("min_corner_score", min_corner_score, 0)
      .that(cell_px > 0 && cell_px % 4 == 0, "cell_px", "a multiple of 4, > 0", cell_px)
      .at_least("max_points", max_points, 1)
      .at_least("min_start_points", min_start_points, 1)
      .at_least("crowded_below", crowded_below, 0)
      .that(small_cell_px > 0 && small_cell_px % 4 == 0, "small_cell_px", "a multiple of 4, > 0",
            small_cell_px)
      .at_least("scarce_points", scarce_points, 0)
      .nested("faint_corners", faint_corners.invalid_reason())
      .at_least("rays_below", rays_below, 0)
      .above("rays_within", rays_within, 0)
      .above("cells_per_corner", cells_per_corner, 0)
      .above("min_disparity_px", min_disparity_px, 0)
      .at_least("max_row_shift", max_row_shift, 0)
      .at_least("mistake_ratio", mistake_ratio, 1)
      .nested("seeds", seeds.invalid_reason())
      .at_least("seeded_points", seeded_points, 0)
      .reason();
}

}  // namespace twofold
