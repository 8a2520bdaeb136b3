// Parts of the sliding window filter: process model and the two orders of elimination.
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "swf_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

TEST(SwfProcessModel, JacobiansAreCentralDifferences) {
  std::mt19937 rng(2);
  for (int trial = 0; trial < 20; ++trial) {
    const SE3 T_prev = SE3::exp(random_vector6(rng, 2, 1)), T_cur = SE3::exp(random_vector6(rng, 2, 1));
    MotionInput input;
    input.T_cur_prev = SE3::exp(random_vector6(rng, 0.5, 0.4)) * T_cur * T_prev.inverse();
    const MotionError error = motion_error(input, T_prev, T_cur);
    const double h = 1e-6;
    for (int i = 0; i < 6; ++i) {
      const Vector6 d = h * Vector6::Unit(i);
      const Vector6 prev = (motion_error(input, SE3::exp(d) * T_prev, T_cur).e -
                            motion_error(input, SE3::exp(-d) * T_prev, T_cur).e) /
                           (2 * h);
      const Vector6 cur = (motion_error(input, T_prev, SE3::exp(d) * T_cur).e -
                           motion_error(input, T_prev, SE3::exp(-d) * T_cur).e) /
                          (2 * h);
      EXPECT_LT((prev - error.J_prev.col(i)).norm(), 1e-7 * (1 + prev.norm()));
      EXPECT_LT((cur - error.J_cur.col(i)).norm(), 1e-7 * (1 + cur.norm()));
    }
  }
}

TEST(SwfProcessModel, VelocityMovesTheBodyForward) {
  // A body that moves along its own x at 2 m/s for 0.5 s has its world pose shifted by one metre along x.
  const SE3 T_c_b(SO3::exp(Vector3(0.3, -0.2, 1.0)), Vector3(0.1, 0.2, 0.3));
  const MotionInput input =
      motion_from_velocity(Vector3(2, 0, 0), Vector3::Zero(), T_c_b, Vector6::Ones(), 0.5);
  const SE3 T_b_w_next = T_c_b.inverse() * compound(input, T_c_b);
  EXPECT_LT((T_b_w_next.inverse().translation() - Vector3(1, 0, 0)).norm(), 1e-12);
}

/// Random equations of a window with prior, measurements and motion.
FilterEquations random_equations(int m, int n, int n_prior) {
  std::mt19937 rng(4);
  std::normal_distribution<double> normal(0, 1);
  const auto draw = [&] { return normal(rng); };
  FilterEquations eq;
  eq.reset(m, n);
  eq.prior_landmarks = n_prior;
  const MatrixX A = MatrixX::NullaryExpr(30, 3 * n_prior + 6, draw);
  eq.prior = A.transpose() * A;
  eq.has_motion = true;
  for (int j = 0; j < m; ++j) {
    for (int l = 0; l < n; ++l) {
      if ((j + l) % 3 == 0) continue;
      const Matrix36 J_p = Matrix36::NullaryExpr(draw);
      const Matrix3 J_l = Matrix3::NullaryExpr(draw);
      eq.U[j] += J_p.transpose() * J_p;
      eq.V[l] += J_l.transpose() * J_l;
      eq.couplings.push_back({j, l, J_p.transpose() * J_l});
    }
    eq.g_poses[j] = Vector6::NullaryExpr(draw);
    if (j + 1 == m) break;
    const Eigen::Matrix<double, 6, 12> D = Eigen::Matrix<double, 6, 12>::NullaryExpr(draw);
    eq.U[j] += D.leftCols<6>().transpose() * D.leftCols<6>();
    eq.U[j + 1] += D.rightCols<6>().transpose() * D.rightCols<6>();
    eq.E[j] += D.leftCols<6>().transpose() * D.rightCols<6>();
  }
  for (int l = 0; l < n; ++l) eq.g_landmarks[l] = Vector3::NullaryExpr(draw);
  return eq;
}

/// The same as one dense matrix, order [landmarks | poses].
MatrixX dense_information(const FilterEquations& eq) {
  const int m = eq.pose_count(), n = eq.landmark_count(), p0 = 3 * n, q = 3 * eq.prior_landmarks;
  MatrixX H = MatrixX::Zero(p0 + 6 * m, p0 + 6 * m);
  for (int l = 0; l < n; ++l) H.block<3, 3>(3 * l, 3 * l) = eq.V[l];
  for (int j = 0; j < m; ++j) {
    H.block<6, 6>(p0 + 6 * j, p0 + 6 * j) = eq.U[j];
    if (j + 1 == m) break;
    H.block<6, 6>(p0 + 6 * j, p0 + 6 * j + 6) = eq.E[j];
    H.block<6, 6>(p0 + 6 * j + 6, p0 + 6 * j) = eq.E[j].transpose();
  }
  for (const auto& c : eq.couplings) {
    H.block<6, 3>(p0 + 6 * c.pose, 3 * c.landmark) += c.W;
    H.block<3, 6>(3 * c.landmark, p0 + 6 * c.pose) += c.W.transpose();
  }
  H.topLeftCorner(q, q) += eq.prior.topLeftCorner(q, q);
  H.block(0, p0, q, 6) += eq.prior.topRightCorner(q, 6);
  H.block(p0, 0, 6, q) += eq.prior.bottomLeftCorner(6, q);
  H.block<6, 6>(p0, p0) += eq.prior.bottomRightCorner<6, 6>();
  return H;
}

TEST(SwfEquations, BothEliminationOrdersAgree) {
  const int m = 5, n = 12, p0 = 3 * n;
  const FilterEquations eq = random_equations(m, n, 4);
  VectorX g(p0 + 6 * m);
  for (int l = 0; l < n; ++l) g.segment<3>(3 * l) = eq.g_landmarks[l];
  for (int j = 0; j < m; ++j) g.segment<6>(p0 + 6 * j) = eq.g_poses[j];
  const MatrixX inverse = dense_information(eq).inverse();
  const VectorX x = inverse * g;

  for (const auto order : {FilterFactor::Order::kMapOntoPath, FilterFactor::Order::kPathOntoMap}) {
    FilterFactor factor;
    ASSERT_TRUE(factor.factorise(eq, 0.0, order));
    FilterStep step;
    factor.solve(eq.g_poses, eq.g_landmarks, step);
    const FilterCovariances covariances = factor.covariances();
    for (int l = 0; l < n; ++l) {
      EXPECT_LT((step.landmarks[l] - x.segment<3>(3 * l)).norm(), 1e-9 * x.norm());
      EXPECT_LT((covariances.landmarks[l] - inverse.block<3, 3>(3 * l, 3 * l)).norm(), 1e-9 * inverse.norm());
    }
    for (int j = 0; j < m; ++j) {
      EXPECT_LT((step.poses[j] - x.segment<6>(p0 + 6 * j)).norm(), 1e-9 * x.norm());
      const Matrix6 expected = inverse.block<6, 6>(p0 + 6 * j, p0 + 6 * j);
      EXPECT_LT((covariances.poses[j] - expected).norm(), 1e-9 * inverse.norm());
    }
  }
}

}  // namespace
}  // namespace twofold
