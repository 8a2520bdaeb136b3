#include "base/option_check.hpp"
#include "imaging/corner_selection.hpp"
#include "imaging/guided_search.hpp"
#include "imaging/plane_warp.hpp"

namespace twofold {

std::string FaintCornerOptions::invalid_reason() const {
  return OptionCheck()
      .above("dark_below", dark_below, 0)
      .share("threshold_share", threshold_share)
      .share("score_share", score_share)
      .reason();
}

std::string CornerSelectionOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("wanted", wanted, 1)
      .within("levels", levels, 1, 3)
      .at_least("threshold", threshold, 1)
      .at_least("min_score", min_score, 0)
      .nested("faint", faint.invalid_reason())
      .reason();
}

std::string GuidedSearchOptions::invalid_reason() const {
  return OptionCheck()
      .above("radius_px", radius_px, 0)
      .above("max_rms", max_rms, 0)
      .above("max_rms_share", max_rms_share, 0)
      .at_least("noise", noise, 0)
      .at_least("refine_iterations", refine_iterations, 1)
      .above("right_search_px", right_search_px, 0)
      .above("gain", gain, 0)
      .reason();
}

std::string SurfaceAlignmentOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_iterations", max_iterations, 1)
      .above("settled_px", settled_px, 0)
      .above("max_move_px", max_move_px, 0)
      .reason();
}

}  // namespace twofold
