// Structure, options and robustness of the sliding window filter.
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "swf_scene.hpp"

namespace twofold::test {
namespace {

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

TEST(SwfEquations, BothEliminationOrdersAgree) {
  std::mt19937 rng(4);
  std::normal_distribution<double> normal(0, 1);
  WindowEquations eq;
  const int m = 5, n = 12, n_prior = 4;
  eq.reset(m, n);
  eq.prior_landmarks = n_prior;
  const MatrixX A = MatrixX::NullaryExpr(30, 3 * n_prior + 6, [&] { return normal(rng); });
  eq.prior = A.transpose() * A;
  eq.has_motion = true;
  for (int j = 0; j < m; ++j) {
    for (int l = 0; l < n; ++l) {
      if ((j + l) % 3 == 0) continue;
      const Matrix36 J_p = Matrix36::NullaryExpr([&] { return normal(rng); });
      const Matrix3 J_l = Matrix3::NullaryExpr([&] { return normal(rng); });
      eq.U[j] += J_p.transpose() * J_p;
      eq.V[l] += J_l.transpose() * J_l;
      eq.couplings.push_back({j, l, J_p.transpose() * J_l});
    }
    eq.g_poses[j] = Vector6::NullaryExpr([&] { return normal(rng); });
    if (j + 1 == m) break;
    const Eigen::Matrix<double, 6, 12> D =
        Eigen::Matrix<double, 6, 12>::NullaryExpr([&] { return normal(rng); });
    eq.U[j] += D.leftCols<6>().transpose() * D.leftCols<6>();
    eq.U[j + 1] += D.rightCols<6>().transpose() * D.rightCols<6>();
    eq.E[j] += D.leftCols<6>().transpose() * D.rightCols<6>();
  }
  for (int l = 0; l < n; ++l) eq.g_landmarks[l] = Vector3::NullaryExpr([&] { return normal(rng); });

  // Dense reference, order [landmarks | poses].
  const int p0 = 3 * n;
  MatrixX H = MatrixX::Zero(p0 + 6 * m, p0 + 6 * m);
  VectorX g(p0 + 6 * m);
  for (int l = 0; l < n; ++l) {
    H.block<3, 3>(3 * l, 3 * l) = eq.V[l];
    g.segment<3>(3 * l) = eq.g_landmarks[l];
  }
  for (int j = 0; j < m; ++j) {
    H.block<6, 6>(p0 + 6 * j, p0 + 6 * j) = eq.U[j];
    g.segment<6>(p0 + 6 * j) = eq.g_poses[j];
    if (j + 1 < m) {
      H.block<6, 6>(p0 + 6 * j, p0 + 6 * j + 6) = eq.E[j];
      H.block<6, 6>(p0 + 6 * j + 6, p0 + 6 * j) = eq.E[j].transpose();
    }
  }
  for (const auto& c : eq.couplings) {
    H.block<6, 3>(p0 + 6 * c.pose, 3 * c.landmark) += c.W;
    H.block<3, 6>(3 * c.landmark, p0 + 6 * c.pose) += c.W.transpose();
  }
  const int q = 3 * n_prior;
  H.topLeftCorner(q, q) += eq.prior.topLeftCorner(q, q);
  H.block(0, p0, q, 6) += eq.prior.topRightCorner(q, 6);
  H.block(p0, 0, 6, q) += eq.prior.bottomLeftCorner(6, q);
  H.block<6, 6>(p0, p0) += eq.prior.bottomRightCorner<6, 6>();
  const MatrixX inverse = H.inverse();
  const VectorX x = inverse * g;

  for (const auto order : {WindowFactor::Order::kMapOntoPath, WindowFactor::Order::kPathOntoMap}) {
    WindowFactor factor;
    ASSERT_TRUE(factor.factorise(eq, 0.0, order));
    WindowStep step;
    factor.solve(eq.g_poses, eq.g_landmarks, step);
    const WindowCovariances covariances = factor.covariances();
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

TEST(SwfFilter, FullWindowEqualsBatch) {
  const SwfScene scene = make_swf_scene({.frames = 9, .points = 40, .seed = 6, .visible = 3.0});
  SlidingWindowFilter batch(scene.rig, exact_options(0)), full(scene.rig, exact_options(9));
  batch.set_first_pose(SE3(), swf_first_information());
  full.set_first_pose(SE3(), swf_first_information());
  for (const WindowFrame& frame : scene.frames) {
    batch.add(frame);  // one solve at the end
    full.step(frame);  // solved at every frame
  }
  batch.optimise();
  for (int j = 0; j < 9; ++j) EXPECT_LT((batch.T_c_w(j) * full.T_c_w(j).inverse()).log().norm(), 1e-9);
  for (int l = 0; l < batch.landmark_count(); ++l) {
    EXPECT_LT((batch.landmark(l) - *full.find_landmark(batch.landmark_id(l))).norm(), 1e-8);
  }
}

double distance_to_batch(const SwfScene& scene, const std::optional<Matrix6>& first, int window,
                         Linearisation linearisation) {
  SlidingWindowFilter batch(scene.rig, exact_options(0));
  SlidingWindowOptions options = exact_options(window);
  options.linearisation = linearisation;
  options.keep_unseen_landmarks = false;
  SlidingWindowFilter filter(scene.rig, options);
  batch.set_first_pose(SE3(), first);
  filter.set_first_pose(SE3(), first);
  for (const WindowFrame& frame : scene.frames) {
    batch.step(frame);
    filter.step(frame);
  }
  EXPECT_LE(filter.pose_count(), window);
  EXPECT_LT(filter.landmark_count(), batch.landmark_count());
  return (filter.newest_T_c_w() * batch.newest_T_c_w().inverse()).log().norm();
}

/// With noise small enough for linearity, marginalising loses nothing: any window gives the newest pose of
/// the batch.
TEST(SwfFilter, AnyWindowEqualsBatchInTheLinearLimit) {
  const SwfScene scene = make_swf_scene(
      {.frames = 9, .points = 40, .seed = 6, .noise_px = 1e-3, .motion_noise = 1e-3, .visible = 3.0});
  for (const int window : {1, 2, 4}) {
    for (const auto linearisation : {Linearisation::kCurrent, Linearisation::kFirstEstimate}) {
      EXPECT_LT(distance_to_batch(scene, std::nullopt, window, linearisation), 1e-7) << "window " << window;
    }
  }
}

/// Pixels a thousand times better than the first pose: where the whole stands is known from the first pose's
/// prior only. Derivatives at moving points leak pixel information into it, first estimates do not.
TEST(SwfFilter, FirstEstimatesKeepWhatNoMeasurementSees) {
  const SwfScene scene = make_swf_scene(
      {.frames = 9, .points = 40, .seed = 6, .noise_px = 1e-3, .motion_noise = 1e-3, .visible = 3.0});
  for (const int window : {2, 4}) {
    const double current = distance_to_batch(scene, swf_first_information(), window, Linearisation::kCurrent);
    const double first =
        distance_to_batch(scene, swf_first_information(), window, Linearisation::kFirstEstimate);
    EXPECT_LT(first, 1e-7) << "window " << window;
    EXPECT_GT(current, 1000 * first) << "window " << window;
  }
}

TEST(SwfFilter, ReusingTheFactorKeepsTheFixedPoint) {
  const SwfScene scene = make_swf_scene({.frames = 8, .points = 40, .seed = 8});
  SlidingWindowOptions options = exact_options(4);
  SlidingWindowFilter fresh(scene.rig, [&] {
    auto o = options;
    o.reuse_factor = false;
    return o;
  }());
  SlidingWindowFilter reused(scene.rig, options);
  fresh.set_first_pose(SE3(), swf_first_information());
  reused.set_first_pose(SE3(), swf_first_information());
  for (const WindowFrame& frame : scene.frames) {
    fresh.step(frame);
    reused.step(frame);
    EXPECT_LT((fresh.newest_T_c_w() * reused.newest_T_c_w().inverse()).log().norm(), 1e-8);
  }
}

TEST(SwfFilter, WorksWithoutProcessModelAndWithTheFirstPoseHeld) {
  const SwfScene scene =
      make_swf_scene({.frames = 10, .points = 60, .seed = 9, .motion = false, .visible = 4.0});
  for (const int window : {0, 1, 2, 5}) {
    SlidingWindowOptions options;
    options.window = window;
    SlidingWindowFilter filter(scene.rig, options);
    filter.set_first_pose(SE3(), std::nullopt);
    for (const WindowFrame& frame : scene.frames) {
      const WindowSummary summary = filter.step(frame);
      EXPECT_TRUE(summary.converged) << "window " << window;
    }
    const Vector6 e = (filter.newest_T_c_w() * scene.T_c_w.back().inverse()).log();
    EXPECT_LT(e.head<3>().norm(), 0.05) << window;
    const auto covariances = filter.covariances();
    ASSERT_TRUE(covariances);
    EXPECT_LT(e.dot(covariances->poses.back().ldlt().solve(e)), 22.5) << window;  // 99.9 % of chi-square(6)
  }
}

TEST(SwfFilter, DeletionHoldsTheOldestPoseAndForgets) {
  const SwfScene scene = make_swf_scene({.frames = 10, .points = 60, .seed = 10, .motion = false});
  SlidingWindowOptions options;
  options.window = 2;
  options.removal = PoseRemoval::kDelete;
  SlidingWindowFilter filter(scene.rig, options);
  filter.set_first_pose(SE3(), std::nullopt);
  SE3 held;
  for (const WindowFrame& frame : scene.frames) {
    held = filter.pose_count() > 0 ? filter.newest_T_c_w() : SE3();
    filter.step(frame);
  }
  EXPECT_EQ(filter.prior().landmark_count(), 0);
  EXPECT_EQ((filter.T_c_w(0).matrix() - held.matrix()).norm(), 0.0);
  EXPECT_EQ(filter.covariances()->poses[0].norm(), 0.0);
  EXPECT_LT((filter.newest_T_c_w() * scene.T_c_w.back().inverse()).log().norm(), 0.3);
}

TEST(SwfFilter, HuberThresholdResistsOutliers) {
  SwfScene scene = make_swf_scene({.frames = 8, .points = 60, .seed = 12, .motion = false});
  std::mt19937 rng(1);
  std::uniform_real_distribution<double> gross(-40, 40), unit(0, 1);
  for (std::size_t j = 1; j < scene.frames.size(); ++j) {
    for (auto& o : scene.frames[j].observations) {
      if (unit(rng) < 0.1) o.z += Vector3(gross(rng), gross(rng), gross(rng));
    }
  }
  double error[2];
  for (const bool robust : {false, true}) {
    SlidingWindowOptions options;
    options.window = 5;
    options.robust = robust;
    options.max_iterations = 20;
    SlidingWindowFilter filter(scene.rig, options);
    filter.set_first_pose(SE3(), std::nullopt);
    WindowSummary summary;
    for (const WindowFrame& frame : scene.frames) summary = filter.step(frame);
    const Vector6 e = (filter.newest_T_c_w() * scene.T_c_w.back().inverse()).log();
    error[robust] = e.norm();
    if (robust) {
      EXPECT_NEAR(summary.inlier_sigma, 1.0, 0.35);
      EXPECT_LT(e.dot(filter.covariances()->poses.back().ldlt().solve(e)), 22.5);  // 99.9 % of chi-square(6)
    }
  }
  EXPECT_LT(error[1], 0.3 * error[0]);
}

TEST(SwfFilter, LeftOnlyMeasurementsContributeAndCannotStartALandmark) {
  SwfScene scene = make_swf_scene({.frames = 6, .points = 40, .seed = 13, .motion = false});
  for (std::size_t j = 1; j < scene.frames.size(); ++j) {
    for (auto& o : scene.frames[j].observations) o.z.z() = Rig::kNoRight;
  }
  LandmarkObservation fresh;
  fresh.landmark = 1000;
  fresh.z = Vector3(300, 200, Rig::kNoRight);
  scene.frames[3].observations.push_back(fresh);
  SlidingWindowOptions options;
  options.window = 3;
  SlidingWindowFilter filter(scene.rig, options);
  filter.set_first_pose(SE3(), std::nullopt);
  for (const WindowFrame& frame : scene.frames) filter.step(frame);
  EXPECT_EQ(filter.landmark_count(), 40);
  EXPECT_FALSE(filter.find_landmark(1000));
  EXPECT_LT((filter.newest_T_c_w() * scene.T_c_w.back().inverse()).log().norm(), 0.1);
}

TEST(SwfFilter, StateStaysBoundedAndRunsAreReproducible) {
  const SwfScene scene =
      make_swf_scene({.frames = 40, .points = 300, .seed = 14, .step = 0.5, .visible = 2.0});
  std::vector<Matrix4> poses[2];
  int largest = 0;
  for (int run = 0; run < 2; ++run) {
    SlidingWindowOptions options;
    options.window = 3;
    SlidingWindowFilter filter(scene.rig, options);
    filter.set_first_pose(SE3(), std::nullopt);
    for (const WindowFrame& frame : scene.frames) {
      largest = std::max(largest, filter.step(frame).landmarks);
      poses[run].push_back(filter.newest_T_c_w().matrix());
    }
  }
  EXPECT_LT(largest, 120);
  for (std::size_t j = 0; j < poses[0].size(); ++j) EXPECT_EQ((poses[0][j] - poses[1][j]).norm(), 0.0);
}

TEST(SwfFilter, InvalidOptionsAreNamed) {
  SlidingWindowOptions options;
  options.window = -1;
  EXPECT_NE(options.invalid_reason().find("window"), std::string::npos);
  EXPECT_THROW(SlidingWindowFilter(Rig{}, options), std::runtime_error);
  EXPECT_TRUE(SlidingWindowOptions{}.invalid_reason().empty());
}

}  // namespace
}  // namespace twofold::test
