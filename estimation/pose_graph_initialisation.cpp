#include "estimation/pose_graph_initialisation.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>

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

/// Nearest rotation in the Frobenius norm: Newton's iteration for the polar factor (Higham 1986), which stays
/// on the side of determinant +1; SVD for the rest.
template <int D>
Square<D> nearest_rotation(const Square<D>& M) {
  Square<D> X = M;
  if (M.determinant() > 1e-6 * std::pow(M.norm(), D)) {
    for (int i = 0; i < 30; ++i) {
      const Square<D> next = 0.5 * (X + X.inverse().transpose());
      const bool done = (next - X).squaredNorm() < 1e-28;
      X = next;
      if (done) return X;
    }
  }
  const Eigen::JacobiSVD<Square<D>> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix<double, D, 1> sign = Eigen::Matrix<double, D, 1>::Ones();
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0) sign[D - 1] = -1;
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

template <class Group, int D>
class Chordal {
 public:
  Chordal(const PoseGraph<Group>& graph, std::span<const int> order)
      : graph_(graph), order_(order), origin_(std::max(graph.origin, 0)) {
    for (const auto& c : graph.constraints) edges_.emplace_back(c.i, c.j);
  }

  std::vector<Group> run() {
    if (!solve_rotations() || !solve_positions()) return graph_.poses;
    std::vector<Group> poses;
    for (std::size_t i = 0; i < rotations_.size(); ++i) {
      const Eigen::Matrix<double, D, 1> t =
          -rotations_[i] * positions_.row(static_cast<Eigen::Index>(i)).transpose();
      poses.push_back(from_rotation(rotations_[i], t));
    }
    poses[origin_] = graph_.poses[origin_];
    return poses;
  }

 private:
  /// Row j of the normal equations: k R_j - k R_ji R_i; the known origin moves to the right-hand side.
  bool solve_rotations() {
    CholmodSolver system;
    const auto slots = system.set_pattern(D, order_, edges_);
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(system.dimension(), D);
    const Square<D> R_origin = rotation_of(graph_.poses[origin_]);
    for (std::size_t e = 0; e < slots.size(); ++e) {
      const auto& c = graph_.constraints[e];
      const double k = c.information.diagonal().template tail<Group::kDof - D>().mean();
      const Square<D> R_ji = rotation_of(c.T_j_i);
      if (c.i != origin_) system.add_diagonal<D>(c.i, k * Square<D>::Identity());
      if (c.j != origin_) system.add_diagonal<D>(c.j, k * Square<D>::Identity());
      if (c.i == origin_) {
        rhs.middleRows<D>(D * c.j) += k * R_ji * R_origin;
      } else if (c.j == origin_) {
        rhs.middleRows<D>(D * c.i) += k * R_ji.transpose() * R_origin;
      } else {
        system.add_off_diagonal<D>(slots[e], -k * R_ji.transpose());
      }
    }
    system.add_diagonal<D>(origin_, Square<D>::Identity());
    rhs.middleRows<D>(D * origin_) = R_origin;
    if (!system.factorise(0)) return false;
    const Eigen::MatrixXd relaxed = system.solve(rhs);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      rotations_.push_back(nearest_rotation<D>(relaxed.middleRows<D>(D * static_cast<Eigen::Index>(i))));
    }
    return relaxed.allFinite();
  }

  /// A graph Laplacian for each coordinate of the positions in the world.
  bool solve_positions() {
    using Scalar = Eigen::Matrix<double, 1, 1>;
    CholmodSolver system;
    const auto slots = system.set_pattern(1, order_, edges_);
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(system.dimension(), D);
    const Eigen::Matrix<double, 1, D> c_origin = graph_.poses[origin_].inverse().translation().transpose();
    for (std::size_t e = 0; e < slots.size(); ++e) {
      const auto& c = graph_.constraints[e];
      const double t = c.information.diagonal().template head<D>().mean();
      const Eigen::Matrix<double, 1, D> shift =
          (rotations_[c.i].transpose() * c.T_j_i.inverse().translation()).transpose();  // c_j - c_i
      if (c.i != origin_) {
        system.add_diagonal<1>(c.i, Scalar(t));
        rhs.row(c.i) -= t * shift;
        if (c.j == origin_) rhs.row(c.i) += t * c_origin;
      }
      if (c.j != origin_) {
        system.add_diagonal<1>(c.j, Scalar(t));
        rhs.row(c.j) += t * shift;
        if (c.i == origin_) rhs.row(c.j) += t * c_origin;
      }
      if (c.i != origin_ && c.j != origin_) system.add_off_diagonal<1>(slots[e], Scalar(-t));
    }
    system.add_diagonal<1>(origin_, Scalar(1.0));
    rhs.row(origin_) = c_origin;
    if (!system.factorise(0)) return false;
    positions_ = system.solve(rhs);
    return positions_.allFinite();
  }

  const PoseGraph<Group>& graph_;
  std::span<const int> order_;
  int origin_;
  std::vector<std::pair<int, int>> edges_;
  std::vector<Square<D>> rotations_;
  Eigen::MatrixXd positions_;
};

}  // namespace

std::vector<SE2> chordal_initialisation(const PoseGraph<SE2>& graph, std::span<const int> order) {
  return Chordal<SE2, 2>(graph, order).run();
}

std::vector<SE3> chordal_initialisation(const PoseGraph<SE3>& graph, std::span<const int> order) {
  return Chordal<SE3, 3>(graph, order).run();
}

}  // namespace twofold
