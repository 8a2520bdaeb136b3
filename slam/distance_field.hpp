#pragma once

#include "surface/free_space/free_space.hpp"
#include "surface/volume.hpp"
#include "twofold/surface.hpp"

namespace twofold {

/// What is known of a position  (SurfaceModel::at).
[[nodiscard]] SpacePoint space_point(const SurfaceVolume& volume, const FreeSpace& free,
                                     const std::array<double, 3>& p_world);

/// SurfaceModel::distances of what a volume and the free space beside it hold.
[[nodiscard]] DistanceField distance_field(const SurfaceVolume& volume, const FreeSpace& free,
                                           const DistanceBox& box);

}  // namespace twofold
