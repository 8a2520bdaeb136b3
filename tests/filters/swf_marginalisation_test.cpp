// Marginalisation: exact on linear problems, against a square-root (QR) form, and inside the filter.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <random>

#include "swf_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

MatrixX random_matrix(int rows, int cols, std::mt19937& rng) {
  std::normal_distribution<double> n(0, 1);
  return MatrixX::NullaryExpr(rows, cols, [&] { return n(rng); });
}

TEST(SwfMarginalisation, LeavesTheMarginalOfTheRestUnchanged) {
  std::mt19937 rng(11);
  for (const int eliminated : {6, 9, 21}) {
    const int n = eliminated + 36;
    const MatrixX J = random_matrix(2 * n, n, rng);
    MatrixX Lambda = J.transpose() * J;
    VectorX g = random_matrix(n, 1, rng);
    const MatrixX Sigma = Lambda.inverse();
    const VectorX x = Sigma * g;
    schur_marginalise(Lambda, g, eliminated, FillIn::kFull);
    const MatrixX expected = Sigma.bottomRightCorner(36, 36);
    EXPECT_LT((Lambda.inverse() - expected).norm(), 1e-10 * expected.norm());
    EXPECT_LT((Lambda.ldlt().solve(g) - x.tail(36)).norm(), 1e-10 * x.norm());
  }
}

TEST(SwfMarginalisation, AgreesWithTheSquareRootFormWhenIllConditioned) {
  // Rows of very different certainty, as a far landmark beside a near one: condition number of Lambda about
  // 1e10.
  std::mt19937 rng(12);
  const int eliminated = 6, n = 42;
  MatrixX J = random_matrix(2 * n, n, rng);
  for (int c = 0; c < n; ++c) J.col(c) *= std::pow(10.0, -5.0 * c / (n - 1));
  VectorX r = random_matrix(2 * n, 1, rng);
  // Square root: triangularise [J r]; the rows below the eliminated block are the marginal.
  const MatrixX R = J.householderQr().matrixQR().topRows(n).triangularView<Eigen::Upper>();
  const MatrixX R_rest = R.bottomRightCorner(n - eliminated, n - eliminated);
  MatrixX Lambda = J.transpose() * J;
  VectorX g = J.transpose() * r;
  schur_marginalise(Lambda, g, eliminated, FillIn::kFull);
  const VectorX scale = Lambda.diagonal().cwiseSqrt().cwiseInverse();
  const MatrixX difference = scale.asDiagonal() * (Lambda - R_rest.transpose() * R_rest) * scale.asDiagonal();
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-10);
  const VectorX x = J.colPivHouseholderQr().solve(r);
  const VectorX x_rest = Lambda.ldlt().solve(g);
  for (int i = 0; i < x_rest.size(); ++i)
    EXPECT_NEAR(x_rest[i], x[eliminated + i], 1e-7 * std::abs(x.tail(1)[0]) + 1e-7);
}

TEST(SwfMarginalisation, LeavesOutDirectionsWithoutInformation) {
  // Two of the eliminated unknowns only ever appear as their sum, and one not at all.
  std::mt19937 rng(14);
  const int eliminated = 6, n = 18;
  MatrixX J = random_matrix(2 * n, n, rng);
  J.col(4) = J.col(1);
  J.col(2).setZero();
  MatrixX Lambda = J.transpose() * J;
  VectorX g = J.transpose() * random_matrix(2 * n, 1, rng);
  const MatrixX A_inv =
      Lambda.topLeftCorner(eliminated, eliminated).completeOrthogonalDecomposition().pseudoInverse();
  const MatrixX B = Lambda.topRightCorner(eliminated, n - eliminated);
  const MatrixX expected =
      Lambda.bottomRightCorner(n - eliminated, n - eliminated) - B.transpose() * A_inv * B;
  const VectorX g_expected = g.tail(n - eliminated) - B.transpose() * A_inv * g.head(eliminated);
  schur_marginalise(Lambda, g, eliminated, FillIn::kFull);
  EXPECT_LT((Lambda - expected).norm(), 1e-9 * expected.norm());
  EXPECT_LT((g - g_expected).norm(), 1e-9 * g_expected.norm());
}

TEST(SwfMarginalisation, BlockDiagonalFillInStaysPositiveAndDropsCrossTerms) {
  std::mt19937 rng(13);
  const int eliminated = 6, n = 18;
  MatrixX J = MatrixX::Zero(24, n);  // a pose that sees four landmarks: no landmark-landmark terms before
  for (int l = 0; l < 4; ++l) {
    J.block(3 * l, 0, 3, 6) = random_matrix(3, 6, rng);
    J.block(3 * l, 6 + 3 * l, 3, 3) = random_matrix(3, 3, rng);
  }
  J.block(12, 0, 6, 6) = random_matrix(6, 6, rng);
  MatrixX Lambda = J.transpose() * J;
  MatrixX full = Lambda;
  VectorX g = random_matrix(n, 1, rng), g_full = g;
  schur_marginalise(Lambda, g, eliminated, FillIn::kBlockDiagonal, {3, 3, 3, 3});
  schur_marginalise(full, g_full, eliminated, FillIn::kFull);
  EXPECT_LT((g - g_full).norm(), 1e-12);
  for (int a = 0; a < 12; a += 3) {
    for (int b = 0; b < 12; b += 3) {
      if (a == b) {
        EXPECT_LT((Lambda.block<3, 3>(a, a) - full.block<3, 3>(a, a)).norm(), 1e-10);
      } else {
        EXPECT_EQ((Lambda.block<3, 3>(a, b).norm()), 0.0);
        EXPECT_GT((full.block<3, 3>(a, b).norm()), 1e-3);
      }
    }
  }
}

/// The filter's own covariances must not change when a pose and the landmarks only it saw are marginalised,
/// as long as nothing new is measured: first-estimate derivatives are then the same before and after.
TEST(SwfMarginalisation, FilterCovariancesSurviveRemoval) {
  for (const auto linearisation : {Linearisation::kCurrent, Linearisation::kFirstEstimate}) {
    const SwfScene scene =
        make_swf_scene({.frames = 5, .points = 40, .seed = 7, .step = 0.8, .visible = 2.5});
    SlidingWindowOptions options = exact_options(5);
    options.linearisation = linearisation;
    options.keep_unseen_landmarks = false;
    SlidingWindowFilter filter(scene.rig, options);
    filter.set_first_pose(SE3(), swf_first_information());
    for (const FilterFrame& frame : scene.frames) filter.step(frame);
    const auto before = filter.covariances();
    ASSERT_TRUE(before);
    const int landmarks = filter.landmark_count();
    std::map<std::int64_t, Matrix3> by_id;
    for (int l = 0; l < landmarks; ++l)
      by_id[filter.landmark_id(l)] = before->landmarks[static_cast<std::size_t>(l)];

    FilterFrame blind;  // moves on, sees nothing
    blind.motion = MotionInput{};
    filter.add(blind);
    const auto after = filter.covariances();
    ASSERT_TRUE(after);
    ASSERT_EQ(filter.pose_count(), 5);
    EXPECT_LT(filter.landmark_count(), landmarks);  // some were seen by the removed pose only
    for (std::size_t j = 0; j < 4; ++j) {
      EXPECT_LT((after->poses[j] - before->poses[j + 1]).norm(), 1e-9 * before->poses[j + 1].norm());
    }
    for (int l = 0; l < filter.landmark_count(); ++l) {
      const Matrix3& expected = by_id.at(filter.landmark_id(l));
      EXPECT_LT((after->landmarks[static_cast<std::size_t>(l)] - expected).norm(), 1e-9 * expected.norm());
    }
  }
}

/// Removal leaves the slope of the cost at the estimate as it is, whatever part of the fill-in is kept and
/// wherever derivatives are taken: without new measurements nothing moves.
TEST(SwfMarginalisation, RemovalNeverMovesTheEstimate) {
  const SwfScene scene = make_swf_scene({.frames = 7, .points = 40, .seed = 9, .noise_px = 1.0});
  for (const auto linearisation : {Linearisation::kCurrent, Linearisation::kFirstEstimate}) {
    for (const auto removal : {PoseRemoval::kMarginalise, PoseRemoval::kMarginaliseDiagonal}) {
      SlidingWindowOptions options = exact_options(3);
      options.linearisation = linearisation;
      options.removal = removal;
      SlidingWindowFilter filter(scene.rig, options);
      filter.set_first_pose(SE3(), swf_first_information());
      for (const FilterFrame& frame : scene.frames) filter.step(frame);
      const SE3 T_before = filter.newest_T_c_w();
      std::map<std::int64_t, Vector3> before;
      for (int l = 0; l < filter.landmark_count(); ++l) before[filter.landmark_id(l)] = filter.landmark(l);

      FilterFrame blind;
      blind.motion = MotionInput{};
      filter.step(blind);
      EXPECT_LT((filter.T_c_w(1) * T_before.inverse()).log().norm(), 1e-8);
      for (const auto& [id, x_w] : before) EXPECT_LT((*filter.find_landmark(id) - x_w).norm(), 1e-7) << id;
    }
  }
}

/// What moves everything is a motion of the frame: found whole in a step, and linear in the prior however far
/// it goes, while the frame's content stays where it is.
TEST(SwfMarginalisation, RigidMotionsBelongToTheFrame) {
  std::mt19937 rng(21);
  std::normal_distribution<double> normal(0, 1);
  FilterPrior prior;
  prior.T_lin = SE3::exp(random_vector6(rng, 500, 1));  // far from the origin
  const SE3 T_l_c = prior.T_lin.inverse();
  for (int l = 0; l < 8; ++l) {
    prior.landmarks_lin.push_back(T_l_c * Vector3(normal(rng), normal(rng), 5 + normal(rng)));
  }
  const int size = 3 * prior.landmark_count() + 6;
  const MatrixX A = MatrixX::NullaryExpr(size + 4, size, [&] { return normal(rng); });
  prior.information = A.transpose() * A;
  prior.vector = VectorX::NullaryExpr(size, [&] { return normal(rng); });
  prior.fit_frame();

  const Vector6 twist = random_vector6(rng, 0.3, 0.1);
  FilterStep step;
  for (const Vector3& x : prior.landmarks_lin) {
    step.landmarks.emplace_back(T_l_c.rotation() *
                                (twist.head<3>() + twist.tail<3>().cross(prior.T_lin * x)));
  }
  step.poses.emplace_back(-twist);
  EXPECT_LT((prior.frame_twist(step) - twist).norm(), 1e-9);

  const VectorX moved = prior.difference(prior.landmarks_lin, prior.T_lin, twist);
  for (int l = 0; l < prior.landmark_count(); ++l) {
    EXPECT_LT((moved.segment<3>(3 * l) - step.landmarks[static_cast<std::size_t>(l)]).norm(), 1e-9);
  }
  const VectorX slope = prior.vector - prior.information * moved;
  const SE3 motion = prior.move_frame(twist);
  EXPECT_LT((prior.vector - slope).norm(), 1e-9 * slope.norm());  // d counts from there: zero now
  EXPECT_LT(prior.difference(prior.landmarks_lin, prior.T_lin).norm(), 1e-9);
  EXPECT_LT((prior.T_lin * motion * T_l_c * SE3::exp(-twist)).log().norm(), 1e-9);
}

}  // namespace
}  // namespace twofold
