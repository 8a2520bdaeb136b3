#include "tracking/monocular/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string MonocularStartOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("candidates", candidates, 1)
      .at_least("frames_between", frames_between, 2)
      .at_least("longest_path", longest_path, 2)
      .share("placed_share", placed_share)
      .at_least("next_flow", next_flow, 0)
      .share("min_left_share", min_left_share)
      .nested("following", following.invalid_reason())
      .nested("wide_following", wide_following.invalid_reason())
      .nested("first_structure", first_structure.invalid_reason())
      .reason();
}

}  // namespace twofold
