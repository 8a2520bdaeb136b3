#pragma once

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <array>
#include <memory>
#include <vector>

#include "estimation/window_problem.hpp"
#include "geometry/inverse_depth.hpp"
#include "tests/estimation/pose_constraint_terms.hpp"

namespace twofold {

/// The same problem for Ceres, with analytic Jacobians.
///
/// Poses are seven numbers (quaternion x y z w, translation) on a manifold with exp(delta) * T. Cost
/// functions put their derivative by delta in the first six columns and zero in the seventh; the manifold's
/// Jacobian picks those six. That spares Ceres the chain rule through the quaternion.
class CeresWindow {
 public:
  using PoseArray = std::array<double, 7>;
  static PoseArray to_array(const SE3& T) {
    const auto& q = T.so3().quaternion();
    const auto& t = T.translation();
    return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
  }
  static SE3 from_array(const double* p) {
    return {SO3(Eigen::Quaterniond(p[3], p[0], p[1], p[2])), Vector3(p[4], p[5], p[6])};
  }

  class LeftPerturbation final : public ceres::Manifold {
   public:
    int AmbientSize() const override { return 7; }
    int TangentSize() const override { return 6; }
    bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
      const PoseArray moved = to_array(SE3::exp(Eigen::Map<const Vector6>(delta)) * from_array(x));
      std::copy(moved.begin(), moved.end(), x_plus_delta);
      return true;
    }
    bool PlusJacobian(const double*, double* jacobian) const override {
      Eigen::Map<Eigen::Matrix<double, 7, 6, Eigen::RowMajor>> J(jacobian);
      J.setZero();
      J.topRows<6>().setIdentity();
      return true;
    }
    bool Minus(const double* y, const double* x, double* difference) const override {
      Eigen::Map<Vector6>{difference} = (from_array(y) * from_array(x).inverse()).log();
      return true;
    }
    bool MinusJacobian(const double*, double* jacobian) const override {
      Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobian);
      J.setZero();
      J.leftCols<6>().setIdentity();
      return true;
    }
  };

  using PoseJacobian = Eigen::Map<Eigen::Matrix<double, 3, 7, Eigen::RowMajor>>;
  using PointJacobian = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;

  /// Whitened error and its derivative by the point in the camera.
  struct Whitened {
    Vector3 error;
    Matrix3 J;
    Whitened(const Rig& rig, const WindowProblem::Observation& o, const Vector3& x) {
      const Vector3 w = o.information.cast<double>().cwiseSqrt();
      error = rig.project(x) - o.z.cast<double>();
      if (o.information.z() == 0) error.z() = 0;
      error = w.cwiseProduct(error);
      J = w.asDiagonal() * rig.project_jacobian(x);
    }
  };

  CeresWindow(const WindowProblem& problem, const WindowSolverOptions& options) : window_(problem) {
    for (const auto& pose : problem.poses) pose_values_.push_back(to_array(pose.T_k_w));
    for (const auto& point : problem.points)
      point_values_.push_back({point.psi.x(), point.psi.y(), point.psi.z()});
    ceres::Problem::Options owner;
    owner.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    owner.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    problem_ = std::make_unique<ceres::Problem>(owner);
    if (options.huber_px > 0) loss_ = std::make_unique<ceres::HuberLoss>(options.huber_px);
    if (options.constraint_huber > 0) {
      constraint_loss_ = std::make_unique<ceres::HuberLoss>(options.constraint_huber);
    }
    add_points();
    add_constraints();
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
    for (auto& psi : point_values_) {
      if (problem_->HasParameterBlock(psi.data())) ordering_->AddElementToGroup(psi.data(), 0);
    }
    for (auto& pose : pose_values_) {
      if (problem_->HasParameterBlock(pose.data())) ordering_->AddElementToGroup(pose.data(), 1);
    }
  }

  ceres::Solver::Summary solve(ceres::Solver::Options options) {
    options.linear_solver_ordering = ordering_;
    options.num_threads = 1;
    ceres::Solver::Summary summary;
    ceres::Solve(options, problem_.get(), &summary);
    return summary;
  }

  [[nodiscard]] ceres::Problem& problem() { return *problem_; }
  /// Parameter blocks.
  [[nodiscard]] const double* pose(int i) const { return pose_values_[i].data(); }
  [[nodiscard]] const double* point(int k) const { return point_values_[k].data(); }
  /// The window with the present values.
  [[nodiscard]] WindowProblem values() const {
    WindowProblem result = window_;
    for (std::size_t i = 0; i < pose_values_.size(); ++i) {
      result.poses[i].T_k_w = from_array(pose_values_[i].data());
    }
    for (std::size_t k = 0; k < point_values_.size(); ++k) {
      result.points[k].psi = Eigen::Map<const Vector3>(point_values_[k].data());
    }
    return result;
  }

 private:
  class AnchorObservation final : public ceres::SizedCostFunction<3, 3> {
   public:
    AnchorObservation(const Rig& rig, const WindowProblem::Observation& o) : rig_(rig), o_(o) {}
    bool Evaluate(const double* const* p, double* residuals, double** jacobians) const override {
      const Vector3 psi = Eigen::Map<const Vector3>(p[0]);
      const Vector3 x = from_inverse_depth(psi);
      if (!(psi.z() > 0)) return false;
      const Whitened w(rig_, o_, x);
      Eigen::Map<Vector3>{residuals} = w.error;
      if (jacobians != nullptr && jacobians[0] != nullptr) {
        PointJacobian{jacobians[0]} = w.J * inverse_depth_jacobian(Matrix3::Identity(), psi);
      }
      return true;
    }

   private:
    const Rig& rig_;
    const WindowProblem::Observation& o_;
  };

  /// Ternary constraint: observer, anchor, point.
  class Observation final : public ceres::SizedCostFunction<3, 7, 7, 3> {
   public:
    Observation(const Rig& rig, const WindowProblem::Observation& o) : rig_(rig), o_(o) {}
    bool Evaluate(const double* const* p, double* residuals, double** jacobians) const override {
      const SE3 T_i_a = from_array(p[0]) * from_array(p[1]).inverse();
      const Matrix3 R = T_i_a.rotation();
      const Vector3 psi = Eigen::Map<const Vector3>(p[2]);
      const Vector3 y = from_inverse_depth(psi);
      const Vector3 x = R * y + T_i_a.translation();
      if (!(psi.z() > 0) || !(x.z() > 0)) return false;
      const Whitened w(rig_, o_, x);
      Eigen::Map<Vector3>{residuals} = w.error;
      if (jacobians == nullptr) return true;
      if (jacobians[0] != nullptr) {
        PoseJacobian J(jacobians[0]);
        J << w.J, -w.J * hat(x), Vector3::Zero();
      }
      if (jacobians[1] != nullptr) {
        const Matrix3 JR = w.J * R;
        PoseJacobian J(jacobians[1]);
        J << -JR, JR * hat(y), Vector3::Zero();
      }
      if (jacobians[2] != nullptr) PointJacobian{jacobians[2]} = w.J * inverse_depth_jacobian(R, psi);
      return true;
    }

   private:
    const Rig& rig_;
    const WindowProblem::Observation& o_;
  };

  class Constraint final : public ceres::SizedCostFunction<6, 7, 7> {
   public:
    explicit Constraint(const WindowProblem::PoseConstraint& c)
        : c_(c), sqrt_information_(c.information.llt().matrixU()) {}
    bool Evaluate(const double* const* p, double* residuals, double** jacobians) const override {
      const auto terms = linearise_pose_constraint(c_.T_j_i, from_array(p[0]), from_array(p[1]));
      Eigen::Map<Vector6>{residuals} = sqrt_information_ * terms.v;
      for (int n = 0; jacobians != nullptr && n < 2; ++n) {
        if (jacobians[n] == nullptr) continue;
        Eigen::Map<Eigen::Matrix<double, 6, 7, Eigen::RowMajor>> J(jacobians[n]);
        J << sqrt_information_ * (n == 0 ? terms.J_i : terms.J_j), Vector6::Zero();
      }
      return true;
    }

   private:
    const WindowProblem::PoseConstraint& c_;
    Matrix6 sqrt_information_;
  };

  void add_pose(int i) {
    double* values = pose_values_[i].data();
    if (problem_->HasParameterBlock(values)) return;
    problem_->AddParameterBlock(values, 7, &manifold_);
    if (window_.poses[i].fixed) problem_->SetParameterBlockConstant(values);
  }

  void add_points() {
    for (std::size_t k = 0; k < window_.points.size(); ++k) {
      const auto& point = window_.points[k];
      double* psi = point_values_[k].data();
      for (int n = 0; n < point.observation_count; ++n) {
        const auto& o = window_.observations[point.first_observation + n];
        if (o.pose == point.anchor) {
          problem_->AddResidualBlock(new AnchorObservation(window_.rig, o), loss_.get(), psi);
        } else {
          add_pose(o.pose);
          add_pose(point.anchor);
          problem_->AddResidualBlock(new Observation(window_.rig, o), loss_.get(),
                                     pose_values_[o.pose].data(), pose_values_[point.anchor].data(), psi);
        }
      }
    }
  }

  void add_constraints() {
    for (const auto& c : window_.constraints) {
      add_pose(c.i);
      add_pose(c.j);
      problem_->AddResidualBlock(new Constraint(c), constraint_loss_.get(), pose_values_[c.i].data(),
                                 pose_values_[c.j].data());
    }
  }

  const WindowProblem window_;
  std::vector<PoseArray> pose_values_;
  std::vector<std::array<double, 3>> point_values_;
  LeftPerturbation manifold_;
  std::unique_ptr<ceres::LossFunction> loss_, constraint_loss_;
  std::unique_ptr<ceres::Problem> problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
};

}  // namespace twofold
