#pragma once

#include <utility>
#include <vector>

#include "estimation/robust_kernel.hpp"
#include "posegraph/pose_graph.hpp"
#include "posegraph/pose_graph_error.hpp"
#include "sparse/sparse_block_solver.hpp"

namespace twofold {

/// Normal equations of a pose graph, and the steps they give. Keeps buffers and symbolic analysis while the
/// structure of the graph stays.
template <class Group>
struct PoseGraphEquations {
  static constexpr int kDof = Group::kDof;
  using Tangent = typename Group::Tangent;
  using Block = typename Group::AdjointMatrix;

  std::vector<std::pair<int, int>> edges;  ///< of the analysed structure
  int poses = -1;
  BlockStructure structure;
  SparseBlockSolver system;
  Eigen::MatrixXd gradient, delta;  ///< H delta = gradient; the step is -delta

  void analyse(const PoseGraph<Group>& graph) {
    std::vector<std::pair<int, int>> now;
    now.reserve(graph.constraints.size());
    for (const auto& c : graph.constraints) now.emplace_back(c.i, c.j);
    if (poses == static_cast<int>(graph.poses.size()) && now == edges) return;
    edges = std::move(now);
    poses = static_cast<int>(graph.poses.size());
    structure = analyse_blocks(poses, edges, kDof);
    system.set_structure(structure, kDof);
  }

  /// Fills the system with H = J^T W J and the gradient J^T W e of half the cost, at graph.poses.
  void linearise(const PoseGraph<Group>& graph, const PoseGraphOptions& options) {
    const HuberKernel kernel{options.huber};
    system.set_zero();
    gradient.setZero(kDof * poses, 1);
    for (std::size_t k = 0; k < graph.constraints.size(); ++k) {
      const auto& c = graph.constraints[k];
      const Group T_i_j = graph.poses[c.i] * graph.poses[c.j].inverse();
      const Group E = c.T_j_i * T_i_j;
      const Tangent e = pose_graph_error(E, options.error);
      // eq. 5.18; and since exp(y) on T_j acts like exp(-Ad y) on T_i with Ad that of T_i_j, J_j = -J_i Ad
      // (5.19)
      const Block J_i = pose_graph_error_jacobian(E, e, options.error, options.jacobian) * c.T_j_i.adjoint();
      const Block ad = T_i_j.adjoint();
      Block information = c.information;
      if (options.huber > 0) information *= kernel.weight(e.dot(c.information * e));
      const Block W_J = information * J_i;
      const Block H_ii = J_i.transpose() * W_J;
      const Tangent g_i = W_J.transpose() * e;
      const Block H_ij = -H_ii * ad;
      const Block H_jj = -ad.transpose() * H_ij;
      if (c.i != graph.origin) {
        system.add_diagonal<kDof>(c.i, H_ii);
        gradient.template block<kDof, 1>(kDof * c.i, 0) += g_i;
      }
      if (c.j != graph.origin) {
        system.add_diagonal<kDof>(c.j, H_jj);
        gradient.template block<kDof, 1>(kDof * c.j, 0) -= ad.transpose() * g_i;
      }
      if (c.i != graph.origin && c.j != graph.origin) system.add_off_diagonal<kDof>(k, H_ij);
    }
    if (graph.origin >= 0) system.add_diagonal<kDof>(graph.origin, Block::Identity());  // its step is zero
  }

  /// poses <- exp(-scale delta) start.
  void move(const std::vector<Group>& start, double scale, std::vector<Group>& moved) const {
    moved.resize(start.size());
    for (int i = 0; i < poses; ++i) {
      moved[i] = Group::exp(-scale * delta.template block<kDof, 1>(kDof * i, 0)) * start[i];
    }
  }
};

}  // namespace twofold
