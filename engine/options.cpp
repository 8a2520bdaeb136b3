#include "engine/options.hpp"

#include "base/option_check.hpp"

namespace twofold {

std::string CheckpointOptions::invalid_reason() const {
  return OptionCheck().at_least("period", period, 0).reason();
}

std::string RunLogOptions::invalid_reason() const {
  return OptionCheck().at_least("frames_in_memory", static_cast<double>(frames_in_memory), 1).reason();
}

std::string EngineOptions::invalid_reason() const {
  OptionCheck check;
  check.nested("tracker", tracker.invalid_reason())
      .nested("mapper", mapper.invalid_reason())
      .nested("loop_closer", loop_closer.invalid_reason())
      .nested("checkpoint", checkpoint.invalid_reason())
      .nested("pacing", pacing.invalid_reason())
      .nested("effort", effort.invalid_reason())
      .nested("logs", logs.invalid_reason())
      .at_least("frame_slots", static_cast<double>(frame_slots), 1)
      .within("proposal_slots", static_cast<double>(proposal_slots), 1, 16);
  check.that(!stepped || !deterministic, "stepped", "false where deterministic is true", 1)
      .that(!stepped || checkpoint.period == 0, "checkpoint.period", "0 where stepped is true",
            checkpoint.period);
  if (tracker_cpu) check.at_least("tracker_cpu", *tracker_cpu, 0);
  if (mapper_cpu) check.at_least("mapper_cpu", *mapper_cpu, 0);
  if (loop_closer_cpu) check.at_least("loop_closer_cpu", *loop_closer_cpu, 0);
  if (fifo_priority) check.within("fifo_priority", *fifo_priority, 1, 99);
  return check.reason();
}

}  // namespace twofold
