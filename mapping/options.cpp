#include "mapping/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string EdgeInformationOptions::invalid_reason() const {
  return OptionCheck().above("trans_share", trans_share, 0).above("rot_share", rot_share, 0).reason();
}

std::string MetricLoopOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("neighbourhood", neighbourhood, 0)
      .at_least("max_searches", max_searches, 0)
      .at_least("columns", columns, 1)
      .at_least("rows", rows, 1)
      .above("search_radius_px", search_radius_px, 0)
      .above("max_error_px", max_error_px, 0)
      .at_least("border_px", border_px, 0)
      .within("min_view_cosine", min_view_cosine, -1, 1)
      .above("max_way_of_one_camera", max_way_of_one_camera, 0)
      .within("min_half_share", min_half_share, 0, 1)
      .nested("consensus", consensus.invalid_reason())
      .reason();
}

std::string CullingOptions::invalid_reason() const {
  return OptionCheck()
      .share("redundant_share", redundant_share)
      .at_least("redundant_observers", redundant_observers, 2)
      .at_least("keep_recent", keep_recent, 0)
      .at_least("max_keyframes", max_keyframes, 0)
      .that(keep_replacements >= max_keyframes, "keep_replacements", ">= max_keyframes", keep_replacements)
      .within("max_misses", max_misses, 1, 255)
      .at_least("view_border_px", view_border_px, 0)
      .within("min_view_cosine", min_view_cosine, -1, 1)
      .at_least("max_scale_change", max_scale_change, 1)
      .reason();
}

std::string GlobalAdjustmentOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("max_keyframes", max_keyframes, 0)
      .at_least("max_iterations", max_iterations, 1)
      .at_least("initial_damping", initial_damping, 0)
      .at_least("relative_decrease", relative_decrease, 0)
      .at_least("rounds", rounds, 1)
      .above("focal_sigma", focal_sigma, 0)
      .reason();
}

std::string MapperOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("inner_window", inner_window, 1)
      .at_least("one_camera_decrease", one_camera_decrease, 0)
      .at_least("outer_window", outer_window, 0)
      .at_least("max_anchors", max_anchors, 0)
      .at_least("max_points", max_points, 1)
      .above("min_inverse_depth", min_inverse_depth, 0)
      .at_least("nearest", nearest, 0)
      .at_least("min_covisible", min_covisible, 1)
      .nested("edge", edge.invalid_reason())
      .nested("solver", solver.invalid_reason())
      .at_least("structure_iterations", structure_iterations, 0)
      .above("outlier_chi2_mono", outlier_chi2_mono, 0)
      .above("outlier_chi2_stereo", outlier_chi2_stereo, 0)
      .nested("loop", loop.invalid_reason())
      .nested("culling", culling.invalid_reason())
      .nested("global", global.invalid_reason())
      .reason();
}

}  // namespace twofold
