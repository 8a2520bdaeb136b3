#pragma once

#include <cstdint>
#include <span>

#include "viewer/scene.hpp"

namespace twofold {

/// A pose that was tracked.
struct TrackedPose {
  std::int64_t t_ns = 0;
  Pose T_world_camera;
  std::uint32_t part = 0;  ///< whose world
};

/// The true path in the world of a tracked pose, which stands where the true pose nearest in time does; at
/// most 4096 positions.
/// @param truth  T_world_camera in any world, not empty
/// @param t_ns   its times, as many, ascending
[[nodiscard]] ViewTruth truth_beside(const TrackedPose& tracked, std::span<const Pose> truth,
                                     std::span<const std::int64_t> t_ns);

}  // namespace twofold
