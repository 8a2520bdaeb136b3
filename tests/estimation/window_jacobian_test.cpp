// Derivatives of the window solver against central differences.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "estimation/observation_model.hpp"
#include "estimation/window_solver.hpp"
#include "fixtures/pose_constraint_terms.hpp"
#include "fixtures/synthetic_window.hpp"

namespace twofold {
namespace {

TEST(ObservationModel, ForceIsHalfTheGradientOfChi2) {
  const ObservationModel model(synthetic_window_detail::make_rig(SensorKind::kStereo));
  std::mt19937 rng(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int n = 0; n < 200; ++n) {
    const Vector3 x(2 * uniform(rng), 2 * uniform(rng), 3 + 2 * uniform(rng));
    const Eigen::Vector3f info(1.0f, 0.5f, n % 2 == 0 ? 0.8f : 0.0f);
    const Eigen::Vector3f z(300, 200, n % 2 == 0 ? 250.0f : std::nanf(""));
    const auto terms = model.linearise(x, z, info, HuberKernel{});
    EXPECT_DOUBLE_EQ(terms.chi2, model.chi2(x, z, info));
    for (int c = 0; c < 3; ++c) {
      const Vector3 h = 1e-6 * Vector3::Unit(c);
      const double numeric = (model.chi2(x + h, z, info) - model.chi2(x - h, z, info)) / 2e-6;
      EXPECT_NEAR(2 * terms.force[c], numeric, 1e-6 * (1 + terms.force.norm()));
    }
  }
}

TEST(ObservationModel, RobustForceIsHalfTheGradientOfRho) {
  const ObservationModel model(synthetic_window_detail::make_rig(SensorKind::kStereo));
  const HuberKernel kernel{1.5};
  const Eigen::Vector3f z(300, 200, 250), info(1, 0.5, 2);
  const Vector3 x(0.3, -0.2, 3);
  ASSERT_GT(model.chi2(x, z, info), 10);
  const auto terms = model.linearise(x, z, info, kernel);
  for (int c = 0; c < 3; ++c) {
    const Vector3 h = 1e-6 * Vector3::Unit(c);
    const double numeric =
        (kernel.rho(model.chi2(x + h, z, info)) - kernel.rho(model.chi2(x - h, z, info))) / 2e-6;
    EXPECT_NEAR(2 * terms.force[c], numeric, 1e-6 * terms.force.norm());
  }
}

TEST(HuberKernel, SideBySideIsAsOneByOne) {
  const HuberKernel kernel{1.5};
  const Eigen::Array4d norms(0, 1.2, 1.6, 80);
  const Eigen::Array4d rho = kernel.rho_of_norms(norms), weights = kernel.weights_of_norms(norms);
  for (int n = 0; n < 4; ++n) {
    EXPECT_NEAR(rho[n], kernel.rho(norms[n] * norms[n]), 1e-12 * (1 + rho[n])) << norms[n];
    EXPECT_NEAR(weights[n], kernel.weight(norms[n] * norms[n]), 1e-15) << norms[n];
  }
}

TEST(ObservationModel, NormalMatrixIsJacobianSquared) {
  const Rig rig = synthetic_window_detail::make_rig(SensorKind::kStereo);
  const ObservationModel model(rig);
  const Vector3 x(0.4, -0.3, 2.5);
  const Eigen::Vector3f info(1.0f, 0.5f, 0.8f);
  Matrix3 J;
  for (int c = 0; c < 3; ++c) {
    const Vector3 h = 1e-6 * Vector3::Unit(c);
    J.col(c) = (rig.project(x + h) - rig.project(x - h)) / 2e-6;
  }
  const auto terms = model.linearise(x, rig.project(x).cast<float>(), info, HuberKernel{});
  const Matrix3 expected = J.transpose() * info.cast<double>().asDiagonal() * J;
  Matrix3 S;
  for (int c = 0; c < 3; ++c) S.col(c) = terms.apply(Vector3::Unit(c));
  EXPECT_LT((S - expected).norm(), 1e-7 * expected.norm());
}

TEST(PoseConstraint, JacobiansMatchCentralDifferences) {
  std::mt19937 rng(11);
  std::normal_distribution<double> normal;
  const auto random_pose = [&](double scale) {
    Vector6 v;
    for (int c = 0; c < 6; ++c) v[c] = scale * normal(rng);
    return SE3::exp(v);
  };
  // From the minimum to errors of a radian and more, on both sides of the series' limit.
  for (const double error : {0.0, 1e-8, 1e-3, 0.1, 0.17, 0.5, 1.0}) {
    for (int n = 0; n < 20; ++n) {
      const SE3 T_i = random_pose(1), T_j = random_pose(1);
      const SE3 T_j_i = random_pose(error) * T_j * T_i.inverse();
      const auto terms = linearise_pose_constraint(T_j_i, T_i, T_j);
      Matrix6 J_i, J_j;
      const double h = 1e-5;
      for (int c = 0; c < 6; ++c) {
        const SE3 plus = SE3::exp(h * Vector6::Unit(c)), minus = SE3::exp(-h * Vector6::Unit(c));
        J_i.col(c) =
            (pose_constraint_error(T_j_i, plus * T_i, T_j) - pose_constraint_error(T_j_i, minus * T_i, T_j)) /
            (2 * h);
        J_j.col(c) =
            (pose_constraint_error(T_j_i, T_i, plus * T_j) - pose_constraint_error(T_j_i, T_i, minus * T_j)) /
            (2 * h);
      }
      if (terms.v.tail<3>().norm() > 2.5) continue;  // close to pi the log itself jumps
      EXPECT_LT((terms.J_i - J_i).norm(), 2e-8 * J_i.norm()) << "error " << error;
      EXPECT_LT((terms.J_j - J_j).norm(), 2e-8 * J_j.norm()) << "error " << error;
    }
  }
}

TEST(PoseConstraint, LeftJacobianInverseHasNoSeamAtItsSeriesLimit) {
  const Vector6 direction = (Vector6() << 0.5, -1, 2, 0.36, 0.48, 0.8).finished();  // rotation part: unit
  const auto J = [&](double theta) -> Matrix6 { return se3_left_jacobian_inverse(theta * direction); };
  EXPECT_LT((J(0.3 - 1e-9) - J(0.3 + 1e-9)).norm(), 1e-8);
}

/// All whitened residuals of a problem with the unknowns moved by delta: six numbers a free pose, then three
/// a point.
Eigen::VectorXd residuals(WindowProblem problem, const Eigen::VectorXd& delta) {
  int at = 0;
  for (auto& pose : problem.poses) {
    if (pose.fixed) continue;
    pose.T_k_w = SE3::exp(delta.segment<6>(at)) * pose.T_k_w;
    at += 6;
  }
  for (auto& point : problem.points) {
    point.psi += delta.segment<3>(at);
    at += 3;
  }
  std::vector<double> values;
  for (const auto& point : problem.points) {
    for (int n = 0; n < point.observation_count; ++n) {
      const auto& o = problem.observations[point.first_observation + n];
      const Vector3 x = problem.poses[o.pose].T_k_w *
                        (problem.poses[point.anchor].T_k_w.inverse() * from_inverse_depth(point.psi));
      const Vector3 e = problem.rig.project(x) - o.pixel.cast<double>();
      for (int c = 0; c < 3; ++c) {
        if (o.information[c] > 0) values.push_back(std::sqrt(o.information[c]) * e[c]);
      }
    }
  }
  for (const auto& c : problem.constraints) {
    const Matrix6 U = c.information.llt().matrixU();
    const Vector6 v = U * (c.T_j_i * problem.poses[c.i].T_k_w * problem.poses[c.j].T_k_w.inverse()).log();
    values.insert(values.end(), v.begin(), v.end());
  }
  return Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

/// One step of dense Levenberg-Marquardt with numerical derivatives, damped as WindowSolver documents it.
Eigen::VectorXd dense_step(const WindowProblem& problem, double lambda) {
  int pose_size = 0;
  for (const auto& pose : problem.poses) pose_size += pose.fixed ? 0 : 6;
  const auto size = pose_size + 3 * static_cast<Eigen::Index>(problem.points.size());
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(size);
  const Eigen::VectorXd e = residuals(problem, zero);
  Eigen::MatrixXd J(e.size(), size);
  for (Eigen::Index c = 0; c < size; ++c) {
    Eigen::VectorXd h = zero;
    h[c] = 1e-6;
    J.col(c) = (residuals(problem, h) - residuals(problem, -h)) / 2e-6;
  }
  Eigen::MatrixXd H = J.transpose() * J;
  H.diagonal() *= 1 + lambda;
  return H.ldlt().solve(-J.transpose() * e);
}

class OneStep : public testing::TestWithParam<int> {};

TEST_P(OneStep, EqualsTheDenseStepWithNumericalJacobians) {
  SyntheticWindowOptions options;
  options.inner = 5;
  options.outer = GetParam() == 0 ? 0 : 4;
  options.points_per_keyframe = 8;
  options.missing_right = 0.3;
  options.pixel_noise = 1;
  options.start_pose_noise = 0.01;
  options.start_depth_noise = 0.02;
  options.constraint_noise = 0.01;
  options.seed = 2;
  WindowProblem problem = make_synthetic_window(options).start;
  ASSERT_GT(problem.points.size(), 10u);
  if (GetParam() == 2) problem.poses[0].fixed = problem.poses[3].fixed = problem.poses[4].fixed = true;
  if (GetParam() == 3) {  // a pose that sees the same point twice
    auto& point = problem.points.back();
    ASSERT_EQ(point.first_observation + point.observation_count,
              static_cast<int>(problem.observations.size()));
    auto again = problem.observations.back();
    again.pixel += Eigen::Vector3f(2, -1, 2);
    problem.observations.push_back(again);
    ++point.observation_count;
  }
  WindowSolverOptions solver_options;
  solver_options.max_iterations = 1;
  solver_options.huber_sigmas = 0;
  solver_options.initial_damping = 1e-3;
  const Eigen::VectorXd delta = dense_step(problem, solver_options.initial_damping);

  WindowProblem solved = problem;
  WindowSolver solver;
  ASSERT_EQ(solver.solve(solved, solver_options).accepted_steps, 1);
  int at = 0;
  for (std::size_t i = 0; i < problem.poses.size(); ++i) {
    if (problem.poses[i].fixed) continue;
    const Vector6 step = (solved.poses[i].T_k_w * problem.poses[i].T_k_w.inverse()).log();
    EXPECT_LT((step - delta.segment<6>(at)).norm(), 1e-6 * delta.head(6).norm() + 1e-7) << "pose " << i;
    at += 6;
  }
  for (std::size_t k = 0; k < problem.points.size(); ++k, at += 3) {
    const Vector3 step = solved.points[k].psi - problem.points[k].psi;
    EXPECT_LT((step - delta.segment<3>(at)).norm(), 1e-7 + 1e-5 * step.norm()) << "point " << k;
  }
}
INSTANTIATE_TEST_SUITE_P(PlainConstrainedFixedTwice, OneStep, testing::Range(0, 4));

}  // namespace
}  // namespace twofold
