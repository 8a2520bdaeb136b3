#include "mapping/options.hpp"

#include <fmt/format.h>

namespace twofold {

std::string MapperOptions::invalid_reason() const {
  const auto wrong = [](const char* field, const char* rule, double value) {
    return fmt::format("{} must be {}, not {}", field, rule, value);
  };
  if (inner_window < 1) return wrong("inner_window", ">= 1", inner_window);
  if (outer_window < 0) return wrong("outer_window", ">= 0", outer_window);
  if (max_anchors < 0) return wrong("max_anchors", ">= 0", max_anchors);
  if (max_points < 1) return wrong("max_points", ">= 1", max_points);
  if (min_covisible < 1) return wrong("min_covisible", ">= 1", min_covisible);
  if (!(edge.sigma_px > 0)) return wrong("edge.sigma_px", "> 0", edge.sigma_px);
  if (!(edge.trans_share > 0)) return wrong("edge.trans_share", "> 0", edge.trans_share);
  if (!(edge.rot_share > 0)) return wrong("edge.rot_share", "> 0", edge.rot_share);
  if (solver.max_iterations < 1) return wrong("solver.max_iterations", ">= 1", solver.max_iterations);
  if (structure_iterations < 0) return wrong("structure_iterations", ">= 0", structure_iterations);
  if (!(sigma_scale > 0)) return wrong("sigma_scale", "> 0", sigma_scale);
  if (!(outlier_chi2_mono > 0)) return wrong("outlier_chi2_mono", "> 0", outlier_chi2_mono);
  if (!(outlier_chi2_stereo > 0)) return wrong("outlier_chi2_stereo", "> 0", outlier_chi2_stereo);
  if (loop.neighbourhood < 0) return wrong("loop.neighbourhood", ">= 0", loop.neighbourhood);
  if (loop.max_searches < 0) return wrong("loop.max_searches", ">= 0", loop.max_searches);
  if (!(loop.max_error_px > 0)) return wrong("loop.max_error_px", "> 0", loop.max_error_px);
  if (!(culling.redundant_share > 0 && culling.redundant_share <= 1)) {
    return wrong("culling.redundant_share", "in (0, 1]", culling.redundant_share);
  }
  if (culling.redundant_observers < 2) {
    return wrong("culling.redundant_observers", ">= 2", culling.redundant_observers);
  }
  if (culling.keep_recent < 0) return wrong("culling.keep_recent", ">= 0", culling.keep_recent);
  if (culling.keep_replacements < culling.max_keyframes) {
    return wrong("culling.keep_replacements", ">= culling.max_keyframes", culling.keep_replacements);
  }
  if (culling.max_misses < 1 || culling.max_misses > 255) {
    return wrong("culling.max_misses", "in [1, 255]", culling.max_misses);
  }
  return {};
}

}  // namespace twofold
