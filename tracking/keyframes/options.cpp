#include "tracking/keyframes/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string KeyframeDecisionOptions::invalid_reason() const {
  return OptionCheck()
      .above("parallax", parallax, 0)
      .within("tracked_share", tracked_share, 0, 1)
      .at_least("waiting_inliers", waiting_inliers, 0)
      .within("lost_share", lost_share, 0, 1)
      .within("waiting_way", waiting_way, 0, 1)
      .within("revisiting_way", revisiting_way, 0, 1)
      .at_least("revisited_after", revisited_after, 1)
      .share("revisited_share", revisited_share)
      .at_least("few_points", few_points, 0)
      .within("few_tracked_share", few_tracked_share, 0, 1)
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
      .at_least("min_gain_share", min_gain_share, 0)
      .reason();
}

}  // namespace twofold
