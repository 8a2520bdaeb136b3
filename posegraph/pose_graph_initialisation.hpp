#pragma once

#include "posegraph/pose_graph.hpp"
#include "sparse/sparse_block_solver.hpp"

namespace twofold {

/// Best positions for given rotations: minimises sum t_ji |c_j - c_i - R_i^T p_ji|^2 over the camera centres
/// c in the world, p_ji the measured centre of j in the frame of i, T_j_i^-1's translation, t the mean
/// diagonal entry of the translation information. Without an origin pose 0 is fixed. The matrix, a weighted
/// graph Laplacian, does not depend on the poses and is factorised once.
template <class Group>
class PoseGraphPositions {
 public:
  static constexpr int kDim = Group::kDof == 6 ? 3 : 2;

  /// @param structure  of the poses, its edges the graph's constraints; must outlive this
  PoseGraphPositions(const PoseGraph<Group>& graph, const BlockStructure& structure);
  /// Sets the positions of all poses but the origin; rotations stay. False, and nothing moves, when
  /// the Laplacian is singular.
  bool update(const PoseGraph<Group>& graph, std::vector<Group>& poses);

 private:
  bool factorised_ = false;
  SparseBlockSolver laplacian_;
};

/// Start values for a pose graph without any of its own: rotations by chordal relaxation (Martinec & Pajdla,
/// CVPR 2007; Carlone et al., ICRA 2015), then positions with the rotations fixed. Two sparse linear
/// least-squares problems.
///
/// Rotations: minimise sum k_ji |R_j - R_ji R_i|_F^2 over matrices, with R_origin fixed, then project each
/// matrix onto the nearest rotation; k is the mean diagonal entry of the rotation information.
///
/// @param structure  of the poses, its edges the graph's constraints
/// @return       poses; the graph's own when a linear system is singular (parts of the graph are not
/// connected)
[[nodiscard]] std::vector<SE2> chordal_initialisation(const PoseGraph<SE2>& graph,
                                                      const BlockStructure& structure,
                                                      PoseGraphPositions<SE2>& positions);
[[nodiscard]] std::vector<SE3> chordal_initialisation(const PoseGraph<SE3>& graph,
                                                      const BlockStructure& structure,
                                                      PoseGraphPositions<SE3>& positions);

}  // namespace twofold
