#pragma once

#include <cstdint>

namespace twofold {

/// What waits for each of the engine's threads; -1: not known.
struct QueueLengths {
  std::int64_t frames = -1;     ///< for the tracker
  std::int64_t keyframes = -1;  ///< for the mapper
  std::int64_t places = -1;     ///< keyframes, for the loop closer
};

}  // namespace twofold
