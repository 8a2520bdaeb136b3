#pragma once

#include <optional>
#include <vector>

#include "experiments/scale_drift/exploration.hpp"
#include "posegraph/pose_graph.hpp"

namespace twofold::bench {

struct LoopConstraint {
  int i = 0, j = 0;  ///< frames, i < j
  Sim3 S_j_i;        ///< maps camera i's frame, in the scale of the map around i, into camera j's
  int inliers = 0;
};

/// Loop closure between a frame and the one among [i_begin, i_end) that shares most points of the scene with
/// it: the points' two estimates, one in either camera's frame, are aligned by a three-point RANSAC on
/// similarities, refined over its inliers with their covariances  (thesis 5.3.1; appearance is not
/// simulated).
///
/// @return  nullopt with fewer than ten inliers
[[nodiscard]] std::optional<LoopConstraint> close_loop(const Rig& rig, const ExplorationResult& map,
                                                       int i_begin, int i_end, int j);

/// Pose graph of an explored map: successive frames joined by what was estimated, with scale one, and the
/// loop constraints  (thesis 5.3.2). SE3: a constraint is the similarity's rotation, and its translation in a
/// unit half way between those of its two ends; the best that a rigid motion can say.
template <class Group>
[[nodiscard]] PoseGraph<Group> pose_graph(const ExplorationResult& map,
                                          const std::vector<LoopConstraint>& loops);

/// Camera centres after optimising the map's pose graph over the group.
template <class Group>
[[nodiscard]] std::vector<Vector3> corrected_centres(const ExplorationResult& map,
                                                     const std::vector<LoopConstraint>& loops);

[[nodiscard]] std::vector<Vector3> camera_centres(const std::vector<SE3>& T_c_w);

/// sqrt(M / n), M = min over s of sum |t_true - s t_cor|^2, t the camera centres seen from `origin`
/// (thesis 5.4); both have the same first pose.
[[nodiscard]] double scaled_rmse(const std::vector<Vector3>& truth, const std::vector<Vector3>& corrected,
                                 const Vector3& origin);

}  // namespace twofold::bench
