#pragma once

#include <optional>

#include "camera/rig.hpp"
#include "graph/snapshot.hpp"

namespace twofold {

/// Covariance [m^2] of a point's position in the world: (sum over its observers of J^T Omega J)^-1,
/// J = d z / d x_w. The poses are taken as true. nullopt where the observers do not tell its position in
/// every direction.
[[nodiscard]] std::optional<Matrix3> point_covariance(const Rig& rig, const GraphSnapshot& graph, PointId id);

}  // namespace twofold
