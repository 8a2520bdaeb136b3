#pragma once

#include <vector>

#include "twofold/source.hpp"

namespace twofold::python {

/// Trajectory of package twofold.
struct PoseList {
  std::vector<StampedPose> poses;
};

}  // namespace twofold::python
