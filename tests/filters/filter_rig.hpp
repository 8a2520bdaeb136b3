#pragma once

#include "camera/rig.hpp"

namespace twofold::testing {

inline Rig make_rig(SensorKind kind) {
  Rig rig;
  rig.kind = kind;
  rig.camera = {500, 500, 319.5, 239.5, 640, 480};
  rig.baseline = 0.1;
  return rig;
}

}  // namespace twofold::testing
