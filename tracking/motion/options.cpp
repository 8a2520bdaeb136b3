#include "tracking/motion/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string MotionModelOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("coast_for", coast_for, 0)
      .above("max_acceleration", max_acceleration, 0)
      .above("reach_slack", reach_slack, 0)
      .reason();
}

}  // namespace twofold
