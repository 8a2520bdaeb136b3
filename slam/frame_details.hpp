#pragma once

#include "camera/rig.hpp"
#include "engine/result.hpp"
#include "twofold/frame_details.hpp"

namespace twofold {

/// What the tracker's report says, as the public face tells it.
struct TWOFOLD_HIDDEN FrameDetails::Impl {
  const Rig& rig;
  const PoseReport& report;
  QueueLengths waiting;
};

}  // namespace twofold
