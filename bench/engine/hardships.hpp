#pragma once

#include <string>
#include <vector>

#include "camera/frame.hpp"
#include "camera/rig.hpp"

namespace twofold {

/// What real cameras do to a recording that a good one is spared: each a function of the frame alone, so that
/// a run can be repeated.
struct Hardship {
  std::string name;
  /// Changes the frame; false if it is not there. `t` counts from the recording's first frame [s].
  bool (*befall)(Frame& frame, double t);
  void (*miscalibrate)(Rig& rig) = [](Rig& /*rig*/) {};  ///< what is told of the cameras is wrong
};

[[nodiscard]] const std::vector<Hardship>& hardships();

}  // namespace twofold
