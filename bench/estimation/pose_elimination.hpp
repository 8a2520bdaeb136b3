#pragma once

#include <Eigen/Cholesky>
#include <optional>
#include <vector>

#include "estimation/observation_model.hpp"
#include "estimation/window_problem.hpp"

namespace twofold {

/// Normal equations of bundle adjustment with the poses eliminated, for problems with few points and many
/// poses: what remains is a dense system of three unknowns a point. Windows of the mapper never look like
/// that, some files of other projects do.
///
/// Points keep their inverse depth form, but about the place their anchor had at the start, which stays put:
/// then an observation depends on one pose and one point, and poses are independent given the points.
/// Pose-pose constraints are not covered.
class PoseElimination {
 public:
  struct Values {
    std::vector<SE3> poses;
    std::vector<Vector3> psi;
  };

  /// By an estimate of the multiplications of both ways; never with pose-pose constraints.
  [[nodiscard]] static bool is_cheaper(const WindowProblem& problem);

  /// Sorts the problem by pose; returns its values. Observations behind their camera are left out.
  [[nodiscard]] Values start(const WindowProblem& problem);
  /// Robustified cost; infinity when an observation comes to lie behind its camera.
  [[nodiscard]] double cost(const WindowSolverOptions& options, const Values& values) const;
  /// Step of the damped normal equations from `values` to `next`; returns the decrease of the cost the
  /// quadratic model promises, nullopt when the system is not positive definite.
  [[nodiscard]] std::optional<double> advance(const WindowSolverOptions& options, const Values& values,
                                              double lambda, Values& next);
  /// Points go back to the frames of their anchors.
  void write_back(const Values& values, WindowProblem& problem) const;

  /// As WindowSolver::solve.
  SolverSummary solve(WindowProblem& problem, const WindowSolverOptions& options);

 private:
  /// Couplings of one pose, transposed: three rows an observation, so that all work on them runs down
  /// columns.
  using Couplings = Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>>;
  /// A point in the world and its derivative by its inverse depth form.
  struct WorldPoint {
    Vector3 x_w;
    Matrix3 dx_dpsi;
  };
  struct Observation {
    int point;
    StereoPixelF pixel;
    Eigen::Vector3f information;
  };
  struct PoseBlock {
    Matrix6 H, L;
    Vector6 gradient, damping, c;  ///< c = L^-1 gradient
  };

  [[nodiscard]] Couplings couplings(int pose) {
    return {couplings_.data() + 18 * begin_[pose], 3 * (begin_[pose + 1] - begin_[pose]), 6};
  }
  void linearise_points(const Values& values);
  void linearise_pose(int pose, const HuberKernel& kernel, const Values& values);
  void eliminate(int pose);

  std::optional<ObservationModel> model_;
  std::vector<SE3> T_w_frame_;  ///< by point
  std::vector<char> fixed_;     ///< by pose; also those that see nothing
  std::vector<int> begin_;      ///< observations of pose i: [begin[i], begin[i + 1])
  std::vector<Observation> observations_;
  std::vector<char> seen_;  ///< by point
  std::vector<PoseBlock> blocks_;
  std::vector<WorldPoint> points_;
  std::vector<double> couplings_;                      ///< pose by pose: B^T W A, then that times L^-T
  Eigen::Matrix<double, Eigen::Dynamic, 3> products_;  // scratch
  std::vector<Matrix3> V_;
  Eigen::VectorXd gradient_;  ///< of the points
  Eigen::VectorXd reduced_gradient_;
  Eigen::MatrixXd reduced_;
};

}  // namespace twofold
