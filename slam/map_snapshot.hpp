#pragma once

#include <memory>

#include "camera/rig.hpp"
#include "slam/map_lender.hpp"
#include "twofold/map.hpp"

namespace twofold {

/// What a snapshot of the public face holds on to.
struct TWOFOLD_HIDDEN MapSnapshot::Impl {
  Rig rig;
  std::shared_ptr<const MapVersion> map;
};

}  // namespace twofold
