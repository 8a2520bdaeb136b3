#pragma once

#include <optional>
#include <vector>

#include "evaluation/evaluation.hpp"
#include "geometry/se3.hpp"
#include "geometry/triangle_mesh.hpp"

namespace twofold {

struct RunAlignment {
  SE3 T_w_e;                 ///< from the run's world to the truth's
  bool by_positions = true;  ///< false: the path is so short or straight that orientations give the rotation
  bool contradictory = false;  ///< orientations do not fit: positions alone were aligned
};

/// How far the cameras stood from the surface: the median over its vertices of the distance to the nearest
/// one [m]. Looks at some thousand vertices and poses, from all over. Neither may be empty.
/// @param estimate  in the same world e as T_e_c of the pairs
[[nodiscard]] double viewing_distance(const TriangleMesh& estimate, const std::vector<PosePair>& pairs);

/// The rigid motion that moves what the cameras saw at `distance` [m] > 0 onto where the true poses saw it:
/// least squares over points that far from each camera, to all six sides along its axes. Positions alone
/// leave the rotation open where the path is short or straight. Orientations that contradict each other (a
/// truth of positions alone, a body's instead of the camera's) are left out.
/// @return  nullopt without pairs, or when such orientations leave positions on one line
[[nodiscard]] std::optional<RunAlignment> align_run(const std::vector<PosePair>& pairs, double distance);

}  // namespace twofold
