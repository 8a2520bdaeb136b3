#pragma once

#include "estimation/cholmod_solver.hpp"
#include "estimation/pose_graph.hpp"

namespace twofold {

/// Start values for a pose graph without any of its own: rotations by chordal relaxation (Martinec & Pajdla,
/// CVPR 2007; Carlone et al., ICRA 2015), then positions with the rotations held. Two sparse linear
/// least-squares problems.
///
/// Rotations: minimise sum k_ji |R_j - R_ji R_i|_F^2 over matrices, with R_origin held, then project each
/// matrix onto the nearest rotation. Positions: minimise sum t_ji |c_j - c_i - R_i^T c_ji|^2. k and t are the
/// mean diagonal entries of the information's rotation and translation parts.
///
/// @param order  elimination order of the poses, the origin last or anywhere
/// @return       poses; the graph's own when a linear system is singular (parts of the graph are not
/// connected)
[[nodiscard]] std::vector<SE2> chordal_initialisation(const PoseGraph<SE2>& graph,
                                                      std::span<const int> order);
[[nodiscard]] std::vector<SE3> chordal_initialisation(const PoseGraph<SE3>& graph,
                                                      std::span<const int> order);

}  // namespace twofold
