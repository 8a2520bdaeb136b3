#include "tracking/pose/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string RoughStartOptions::invalid_reason() const {
  return OptionCheck()
      .share("inlier_share", inlier_share)
      .share("searched_share", searched_share)
      .at_least("min_inliers", min_inliers, 0)
      .at_least("min_mapped", min_mapped, 0)
      .at_least("rounds", rounds, 1)
      .reason();
}

std::string PoseOptions::invalid_reason() const {
  return OptionCheck()
      .nested("motion", motion.invalid_reason())
      .nested("elders", elders.invalid_reason())
      .at_least("min_inliers", min_inliers, 3)
      .within("min_inlier_share", min_inlier_share, 0, 1)
      .share("doubted_inlier_share", doubted_inlier_share)
      .share("doubted_searched_share", doubted_searched_share)
      .within("settled_searched_share", settled_searched_share, 0, 1)
      .nested("rough", rough.invalid_reason())
      .at_least("shutter_rounds", shutter_rounds, 1)
      .at_least("shutter_settled", shutter_settled, 0)
      .nested("uncertainty", uncertainty.invalid_reason())
      .reason();
}

}  // namespace twofold
