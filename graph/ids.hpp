#pragma once

#include <cstdint>

namespace twofold {

/// Both number from 0 without gaps and never change their meaning. The tracker hands them out when it
/// proposes.
enum class KeyframeId : std::uint32_t {};
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
