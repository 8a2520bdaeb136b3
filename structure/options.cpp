#include "structure/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string StructureOptions::invalid_reason() const {
  return OptionCheck()
      .nested("filter", filter.invalid_reason())
      .at_least("features", features, 8)
      .above("sigma_px", sigma_px, 0)
      .at_least("refinements", refinements, 0)
      .that(corner_cell_px >= 4 && corner_cell_px % 4 == 0, "corner_cell_px", "a positive multiple of 4",
            corner_cell_px)
      .at_least("cell_px", cell_px, 1)
      .at_least("corner_threshold", corner_threshold, 1)
      .at_least("min_corner_score", min_corner_score, 0)
      .above("min_disparity_px", min_disparity_px, 0)
      .above("search_share", search_share, 0)
      .that(max_sad_ratio > 0 && max_sad_ratio < 1, "max_sad_ratio", "in (0, 1)", max_sad_ratio)
      .nested("consistency", consistency.invalid_reason())
      .at_least("min_matches", min_matches, 3)
      .above("max_residual_px", max_residual_px, 0)
      .nested("search", search.invalid_reason())
      .reason();
}

}  // namespace twofold
