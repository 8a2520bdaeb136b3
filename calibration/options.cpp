#include "base/option_check.hpp"
#include "calibration/calibrate.hpp"
#include "calibration/view_guide.hpp"

namespace twofold {

std::string CalibrationOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("min_views", min_views, 3)
      .within("min_coverage", min_coverage, 0, 1)
      .at_least("min_tilted", min_tilted, 0)
      .at_least("min_tilt", min_tilt, 0)
      .above("max_rms_px", max_rms_px, 0)
      .above("max_focal_std", max_focal_std, 0)
      .above("max_baseline_std", max_baseline_std, 0)
      .at_least("outlier", outlier, 0)
      .reason();
}

std::string ViewGuideOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("wanted_views", wanted_views, 3)
      .at_least("max_views", max_views, wanted_views)
      .within("wanted_coverage", wanted_coverage, 0, 1)
      .at_least("wanted_tilt", wanted_tilt, 0)
      .at_least("wanted_zoom", wanted_zoom, 1)
      .at_least("novelty", novelty, 0)
      .at_least("novelty_angle", novelty_angle, 0)
      .reason();
}

}  // namespace twofold
