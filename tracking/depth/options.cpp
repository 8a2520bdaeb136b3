#include "tracking/depth/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string DepthPlacementOptions::invalid_reason() const {
  return OptionCheck()
      .nested("alignment", alignment.invalid_reason())
      .at_least("scarce_inliers", scarce_inliers, 0)
      .at_least("telling_candidates", telling_candidates, 0)
      .share("agreeing_share", agreeing_share)
      .at_least("patience", patience, 0)
      .reason();
}

}  // namespace twofold
