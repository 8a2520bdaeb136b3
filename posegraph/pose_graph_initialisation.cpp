#include "posegraph/pose_graph_initialisation.hpp"

#include <Eigen/LU>

#include "geometry/nearest_rotation.hpp"

namespace twofold {
namespace {

template <int D>
using Square = Eigen::Matrix<double, D, D>;

Square<2> rotation_of(const SE2& T) {
  return T.rotation();
}
Square<3> rotation_of(const SE3& T) {
  return T.rotation();
}

SE2 from_rotation(const Square<2>& R, const Vector2& t) {
  return {std::atan2(R(1, 0), R(0, 0)), t};
}
SE3 from_rotation(const Square<3>& R, const Vector3& t) {
  return {R, t};
}

/// Row j of the normal equations: k R_j - k R_ji R_i; the known origin moves to the right-hand side.
template <int D, class Group>
std::vector<Square<D>> relaxed_rotations(const PoseGraph<Group>& graph, const BlockStructure& structure) {
  const int origin = std::max(graph.origin, 0);
  SparseBlockSolver system;
  system.set_structure(structure, D);
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(system.dimension(), D);
  const Square<D> R_origin = rotation_of(graph.poses[origin]);
  for (std::size_t e = 0; e < graph.constraints.size(); ++e) {
    const auto& c = graph.constraints[e];
    const double k = c.information.diagonal().template tail<Group::kDof - D>().mean();
    const Square<D> k_R_ji = k * rotation_of(c.T_j_i);
    if (c.i != origin) system.add_diagonal<D>(c.i, k * Square<D>::Identity());
    if (c.j != origin) system.add_diagonal<D>(c.j, k * Square<D>::Identity());
    if (c.i == origin) {
      rhs.middleRows<D>(D * c.j) += k_R_ji * R_origin;
    } else if (c.j == origin) {
      rhs.middleRows<D>(D * c.i) += k_R_ji.transpose() * R_origin;
    } else {
      system.add_off_diagonal<D>(e, -k_R_ji.transpose());
    }
  }
  system.add_diagonal<D>(origin, Square<D>::Identity());
  rhs.middleRows<D>(D * origin) = R_origin;
  std::vector<Square<D>> rotations;
  if (!system.factorise(0)) return rotations;
  const Eigen::MatrixXd relaxed = system.solve(rhs);
  if (!relaxed.allFinite()) return rotations;
  for (int i = 0; i < structure.nodes(); ++i) {
    rotations.push_back(nearest_rotation(Square<D>(relaxed.middleRows<D>(D * i))));
  }
  return rotations;
}

template <int D, class Group>
std::vector<Group> chordal(const PoseGraph<Group>& graph, const BlockStructure& structure,
                           PoseGraphPositions<Group>& positions) {
  const auto rotations = relaxed_rotations<D>(graph, structure);
  std::vector<Group> poses = graph.poses;
  if (rotations.empty()) return poses;
  const int origin = std::max(graph.origin, 0);
  for (int i = 0; i < static_cast<int>(poses.size()); ++i) {
    if (i != origin) poses[i] = from_rotation(rotations[i], Eigen::Matrix<double, D, 1>::Zero());
  }
  return positions.update(graph, poses) ? poses : graph.poses;
}

template <class Group>
double translation_weight(const typename PoseGraph<Group>::Constraint& c) {
  return c.information.diagonal().template head<PoseGraphPositions<Group>::kDim>().mean();
}

}  // namespace

template <class Group>
PoseGraphPositions<Group>::PoseGraphPositions(const PoseGraph<Group>& graph,
                                              const BlockStructure& structure) {
  using Scalar = Eigen::Matrix<double, 1, 1>;
  const int origin = std::max(graph.origin, 0);
  laplacian_.set_structure(structure, 1);
  for (std::size_t e = 0; e < graph.constraints.size(); ++e) {
    const auto& c = graph.constraints[e];
    const double t = translation_weight<Group>(c);
    if (c.i != origin) laplacian_.add_diagonal<1>(c.i, Scalar(t));
    if (c.j != origin) laplacian_.add_diagonal<1>(c.j, Scalar(t));
    if (c.i != origin && c.j != origin) laplacian_.add_off_diagonal<1>(e, Scalar(-t));
  }
  laplacian_.add_diagonal<1>(origin, Scalar(1.0));
  factorised_ = laplacian_.factorise(0);
}

template <class Group>
bool PoseGraphPositions<Group>::update(const PoseGraph<Group>& graph, std::vector<Group>& poses) {
  if (!factorised_) return false;
  using Row = Eigen::Matrix<double, 1, kDim>;
  const int origin = std::max(graph.origin, 0);
  const Row c_origin = poses[origin].inverse().translation().transpose();
  Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(laplacian_.dimension(), kDim);
  for (const auto& c : graph.constraints) {
    const double t = translation_weight<Group>(c);
    const Row shift =
        (rotation_of(poses[c.i]).transpose() * c.T_j_i.inverse().translation()).transpose();  // c_j - c_i
    if (c.i != origin) rhs.row(c.i) += t * ((c.j == origin ? c_origin : Row::Zero().eval()) - shift);
    if (c.j != origin) rhs.row(c.j) += t * ((c.i == origin ? c_origin : Row::Zero().eval()) + shift);
  }
  rhs.row(origin) = c_origin;
  const Eigen::MatrixXd centres = laplacian_.solve(rhs);
  if (!centres.allFinite()) return false;
  for (int i = 0; i < static_cast<int>(poses.size()); ++i) {
    if (i != origin) poses[i].translation() = -(rotation_of(poses[i]) * centres.row(i).transpose());
  }
  return true;
}

std::vector<SE2> chordal_initialisation(const PoseGraph<SE2>& graph, const BlockStructure& structure,
                                        PoseGraphPositions<SE2>& positions) {
  return chordal<2>(graph, structure, positions);
}

std::vector<SE3> chordal_initialisation(const PoseGraph<SE3>& graph, const BlockStructure& structure,
                                        PoseGraphPositions<SE3>& positions) {
  return chordal<3>(graph, structure, positions);
}

template class PoseGraphPositions<SE2>;
template class PoseGraphPositions<SE3>;

}  // namespace twofold
