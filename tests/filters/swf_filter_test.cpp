// Structure, options and robustness of the sliding window filter.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "swf_scene.hpp"

namespace twofold {
namespace {

using namespace testing;

TEST(SwfFilter, FullWindowEqualsBatch) {
  const SwfScene scene = make_swf_scene({.frames = 9, .points = 40, .seed = 6, .visible = 3.0});
  SlidingWindowFilter batch(scene.rig, exact_options(0)), full(scene.rig, exact_options(9));
  batch.set_first_pose(SE3(), swf_first_information());
  full.set_first_pose(SE3(), swf_first_information());
  for (const FilterFrame& frame : scene.frames) {
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
  for (const FilterFrame& frame : scene.frames) {
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
  for (const FilterFrame& frame : scene.frames) {
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
    for (const FilterFrame& frame : scene.frames) {
      const FilterSummary summary = filter.step(frame);
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
  for (const FilterFrame& frame : scene.frames) {
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
      if (unit(rng) < 0.1) o.pixel += Vector3(gross(rng), gross(rng), gross(rng));
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
    FilterSummary summary;
    for (const FilterFrame& frame : scene.frames) summary = filter.step(frame);
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
    for (auto& o : scene.frames[j].observations) o.pixel.z() = Rig::kNoRight;
  }
  LandmarkObservation fresh;
  fresh.landmark = 1000;
  fresh.pixel = Vector3(300, 200, Rig::kNoRight);
  scene.frames[3].observations.push_back(fresh);
  SlidingWindowOptions options;
  options.window = 3;
  SlidingWindowFilter filter(scene.rig, options);
  filter.set_first_pose(SE3(), std::nullopt);
  for (const FilterFrame& frame : scene.frames) filter.step(frame);
  EXPECT_EQ(filter.landmark_count(), 40);
  EXPECT_FALSE(filter.find_landmark(1000));
  EXPECT_LT((filter.newest_T_c_w() * scene.T_c_w.back().inverse()).log().norm(), 0.1);
}

/// A measurement of the left image alone has two components, not three.
TEST(SwfFilter, SpreadOfLeftOnlyMeasurementsIsThatOfTheOthers) {
  double mean = 0;
  constexpr int kScenes = 6;
  for (int n = 0; n < kScenes; ++n) {
    SwfScene scene =
        make_swf_scene({.frames = 8, .points = 60, .seed = 20U + static_cast<unsigned>(n), .motion = false});
    for (std::size_t j = 1; j < scene.frames.size(); ++j) {
      for (auto& o : scene.frames[j].observations) o.pixel.z() = Rig::kNoRight;
    }
    SlidingWindowOptions options = exact_options(0);
    SlidingWindowFilter filter(scene.rig, options);
    filter.set_first_pose(SE3(), std::nullopt);
    FilterSummary summary;
    for (const FilterFrame& frame : scene.frames) summary = filter.step(frame);
    EXPECT_LE(summary.outliers, 1);
    mean += summary.inlier_sigma / kScenes;
  }
  EXPECT_NEAR(mean, 1, 0.04);
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
    for (const FilterFrame& frame : scene.frames) {
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
}  // namespace twofold
