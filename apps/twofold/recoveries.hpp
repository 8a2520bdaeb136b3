#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "engine/result.hpp"

namespace twofold {

/// A frame at which the lost camera was placed again.
struct Recovery {
  std::int64_t frame = 0;
  std::int64_t t_ns = 0;
  int lost_frames = 0;    ///< that were looked at in vain before it
  bool new_part = false;  ///< it did not find itself, and began a map part with a world of its own
  /// From the last frame that was tracked before to this one, in the final map; nothing when that has them in
  /// different parts.
  std::optional<SE3> T_last_now;
};

/// All of a run, in their order. Not the start of its first map, before which there was nothing to be found
/// in.
/// @param loaded_keyframes  of the map that it began with, which has the first ids; 0: of none
[[nodiscard]] std::vector<Recovery> recoveries(const RunResult& result, std::uint32_t loaded_keyframes);

}  // namespace twofold
