#include "tracking/loss/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string WideSearchOptions::invalid_reason() const {
  return OptionCheck()
      .nested("corners", corners.invalid_reason())
      .at_least("max_distance", max_distance, 1)
      .at_least("min_agreeing", min_agreeing, 3)
      .nested("consensus", consensus.invalid_reason())
      .at_least("min_turned", min_turned, 2)
      .above("turned_within", turned_within, 0)
      .at_least("max_turns", max_turns, 1)
      .reason();
}

std::string LossOptions::invalid_reason() const {
  return OptionCheck()
      .nested("wide_search", wide_search.invalid_reason())
      .nested("signs", signs.invalid_reason())
      .at_least("recent_keyframes", recent_keyframes, 1)
      .at_least("coast_after", coast_after, 1)
      .at_least("new_part_after", new_part_after, 0)
      .at_least("new_part_frames", new_part_frames, 0)
      .at_least("min_corners_seen", min_corners_seen, 0)
      .reason();
}

}  // namespace twofold
