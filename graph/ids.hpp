#pragma once

#include <cstdint>

namespace twofold {

/// Number of a keyframe in its map: the first is 0, the next one 1. It never stands for another keyframe,
/// even after this one was culled. The tracker chooses it when it proposes the keyframe.
enum class KeyframeId : std::uint32_t {};
/// The same for points; a point gets its number when it is found in a second keyframe.
enum class PointId : std::uint32_t {};

inline constexpr KeyframeId kNoKeyframe{0xffffffffU};
inline constexpr PointId kNoPoint{0xffffffffU};

[[nodiscard]] constexpr std::uint32_t index(KeyframeId id) {
  return static_cast<std::uint32_t>(id);
}
[[nodiscard]] constexpr std::uint32_t index(PointId id) {
  return static_cast<std::uint32_t>(id);
}

}  // namespace twofold
