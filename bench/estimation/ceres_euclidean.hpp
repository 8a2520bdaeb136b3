#pragma once

#include "fixtures/ceres_window.hpp"

namespace twofold {

/// A window's points for Ceres in the usual form of bundle adjustment: Euclidean points in the world, each
/// residual with one pose and one point. The cost is the same, the unknowns are not. No pose-pose
/// constraints.
class CeresEuclidean {
 public:
  CeresEuclidean(const WindowProblem& problem, const WindowSolverOptions& options) : window_(problem) {
    for (const auto& pose : problem.poses) poses_.push_back(CeresWindow::to_array(pose.T_k_w));
    for (const auto& point : problem.points) {
      points_.push_back(problem.poses[point.anchor].T_k_w.inverse() * from_inverse_depth(point.psi));
    }
    ceres::Problem::Options owner;
    owner.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    owner.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_ = std::make_unique<ceres::Problem>(owner);
    if (options.huber_sigmas > 0) loss_ = std::make_unique<ceres::HuberLoss>(options.huber_sigmas);
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      problem_->AddParameterBlock(poses_[i].data(), 7, &manifold_);
      if (problem.poses[i].fixed) problem_->SetParameterBlockConstant(poses_[i].data());
      ordering_->AddElementToGroup(poses_[i].data(), 1);
    }
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const auto& point = window_.points[k];
      for (int n = 0; n < point.observation_count; ++n) {
        const auto& o = window_.observations[point.first_observation + n];
        problem_->AddResidualBlock(new Observation(window_.rig, o), loss_.get(), poses_[o.pose].data(),
                                   points_[k].data());
      }
      ordering_->AddElementToGroup(points_[k].data(), 0);
    }
  }

  ceres::Solver::Summary solve(ceres::Solver::Options options) {
    options.linear_solver_ordering = ordering_;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem_.get(), &summary);
    return summary;
  }

 private:
  class Observation final : public ceres::SizedCostFunction<3, 7, 3> {
   public:
    Observation(const Rig& rig, const WindowProblem::Observation& o) : rig_(rig), o_(o) {}
    bool Evaluate(const double* const* p, double* residuals, double** jacobians) const override {
      const SE3 T = CeresWindow::from_array(p[0]);
      const Vector3 x = T * Vector3(Eigen::Map<const Vector3>(p[1]));
      if (!(x.z() > 0)) return false;
      const CeresWindow::Whitened w(rig_, o_, x);
      Eigen::Map<Vector3>{residuals} = w.error;
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        CeresWindow::PoseJacobian J(jacobians[0]);
        J << w.J, -w.J * hat(x), Vector3::Zero();
      }
      if (jacobians != nullptr && jacobians[1] != nullptr) {
        CeresWindow::PointJacobian{jacobians[1]} = w.J * T.rotation();
      }
      return true;
    }

   private:
    const Rig& rig_;
    const WindowProblem::Observation& o_;
  };

  const WindowProblem window_;
  std::vector<CeresWindow::PoseArray> poses_;
  std::vector<Vector3> points_;
  CeresWindow::LeftPerturbation manifold_;
  std::unique_ptr<ceres::LossFunction> loss_;
  std::unique_ptr<ceres::Problem> problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
};

}  // namespace twofold
