#include "tracking/motion/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string MotionModelOptions::invalid_reason() const {
  return OptionCheck()
      .at_least("jitter", jitter, 0)
      .at_least("coast_for", coast_for, 0)
      .above("max_acceleration", max_acceleration, 0)
      .above("reach_slack", reach_slack, 0)
      .reason();
}

std::string ShutterOptions::invalid_reason() const {
  return OptionCheck()
      .nested("readout", readout.invalid_reason())
      .above("unknown_readout", unknown_readout, 0)
      .at_least("bent_depth", bent_depth, 0)
      .reason();
}

}  // namespace twofold
