#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "camera/rig.hpp"
#include "slam/map_lender.hpp"
#include "twofold/map.hpp"

namespace twofold {

/// What a snapshot of the public face holds on to.
struct TWOFOLD_HIDDEN MapSnapshot::Impl {
  Rig rig;
  std::shared_ptr<const MapVersion> map;
  std::uint32_t loaded_keyframes = 0;  ///< of the map that the run went on with, which has the first ids
  /// Rows that right images lie lower than left ones, as the tracker takes them back now [px]: the run's, not
  /// the version's. Null: of no run.
  std::shared_ptr<const std::atomic<double>> row_offset = {};
};

}  // namespace twofold
