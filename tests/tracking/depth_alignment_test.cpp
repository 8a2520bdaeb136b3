#include "tracking/depth/depth_alignment.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cstdio>
#include <numeric>
#include <random>
#include <vector>

#include "fixtures/rendered_scene.hpp"
#include "tests/allocation_counter.hpp"
#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

constexpr double kNoise = 1.5e-3;  // of a reading, at a depth of 1 m [m]

SE3 turned(double down, double aside) {
  return {SO3::exp(Vector3(down, aside, 0)), Vector3::Zero()};
}

/// A room whose walls say nothing but where they are.
class DepthAlignmentTest : public ::testing::Test {
 protected:
  cv::Mat depth(const SE3& T_c_w) {
    cv::Mat image = scene_.render_depth(T_c_w);
    std::normal_distribution<double> noise(0, kNoise);
    for (int v = 0; v < image.rows; ++v) {
      for (int u = 0; u < image.cols; ++u) {
        std::uint16_t& reading = image.at<std::uint16_t>(v, u);
        const double metres = reading * rig_.depth_unit;
        reading =
            static_cast<std::uint16_t>((metres + metres * metres * noise(random_)) / rig_.depth_unit + 0.5);
      }
    }
    return image;
  }
  /// Points on what is seen, as a search would have found them.
  std::vector<MotionObservation> corners(const SE3& T_ref_w, const SE3& T_c_w, int count) {
    std::uniform_real_distribution<double> u(20, 300), v(20, 220);
    std::normal_distribution<float> noise(0, 0.5F);
    std::vector<MotionObservation> found;
    for (int i = 0; i < count; ++i) {
      const Vector2 uv(u(random_), v(random_));
      const Vector3 x_c = rig_.camera.unproject(uv) * scene_.depth(T_c_w, uv);
      Eigen::Vector3f z = rig_.project(x_c).cast<float>();
      for (int k = 0; k < 3; ++k) z[k] += noise(random_);
      found.push_back(observe_point(rig_, T_ref_w * (T_c_w.inverse() * x_c), z, 0));
    }
    return found;
  }

  Rig rig_ = test_rig(SensorKind::kRgbd, 320, 240);
  RenderedScene scene_{rig_, {1.5, 1.2, 2.5}, 11};
  std::mt19937 random_{5};
  const SE3 T_corner_w_ = turned(0.5, 0.6);  // three walls in view
  DepthAlignment alignment_{rig_, {}};
};

TEST_F(DepthAlignmentTest, PlacesACameraInACornerOfABareRoom) {
  const SE3 T_step = SE3::exp((Vector6() << 0.02, -0.01, 0.015, 0.01, 0.02, -0.01).finished());
  SE3 T_c_w = T_corner_w_, T_said_w = T_corner_w_;
  const cv::Mat first = depth(T_corner_w_);
  double nees = 0;
  constexpr int kSteps = 10;
  for (int i = 0; i < kSteps; ++i) {
    T_c_w = T_step * T_c_w;
    const cv::Mat current = depth(T_c_w);
    const std::size_t before = testing::allocations();
    alignment_.look_at(current);
    alignment_.clear_views();
    alignment_.add_view(KeyframeId{0}, first, SE3());
    const auto placed = alignment_.align(T_said_w * T_corner_w_.inverse(), {});
    EXPECT_EQ(testing::allocations(), before) << i;
    ASSERT_TRUE(placed) << i << ": " << describe(placed.error());
    T_said_w = placed->T_c_ref * T_corner_w_;
    const Vector6 error = (T_said_w * T_c_w.inverse()).log();
    EXPECT_LT(error.head<3>().norm(), 0.001) << i;
    EXPECT_LT(error.tail<3>().norm(), 0.0005) << i;
    nees += error.dot(placed->covariance.ldlt().solve(error)) / (6 * kSteps);
  }
  EXPECT_LT(nees, 2);  // one keyframe's noise is in all of them
}

TEST_F(DepthAlignmentTest, SeveralKeyframesSayMoreThanOne) {
  const SE3 T_ref_w = T_corner_w_;
  const SE3 T_c_w = SE3(SO3::exp(Vector3(0.02, -0.03, 0.01)), Vector3(0.03, 0.02, -0.04)) * T_corner_w_;
  const auto information = [&](int views) {
    alignment_.look_at(depth(T_c_w));
    alignment_.clear_views();
    for (int k = 0; k < views; ++k) {
      const SE3 T_view_ref(SO3::exp(Vector3(0, 0.01 * k, 0)), Vector3(0.01 * k, 0, 0));
      alignment_.add_view(KeyframeId{static_cast<std::uint32_t>(10 * views + k)}, depth(T_view_ref * T_ref_w),
                          T_view_ref);
    }
    const auto placed = alignment_.align(SE3(), {});
    return placed ? placed->information.trace() : 0;
  };
  const double one = information(1);
  EXPECT_GT(one, 0);
  // Half of one view's variance is the frame's own, and stays: of any number of views no more than twice is
  // known.
  const double three = information(3);
  EXPECT_GT(three, 1.2 * one);
  EXPECT_LT(three, 2 * one);
}

/// The frame's own noise is in what it says of every view: counted once for each, four views knew the pose
/// more than twice as well as they do. What is judged is the scatter: where two walls meet, planes are wrong
/// by the same in every trial.
TEST_F(DepthAlignmentTest, KnowsHowFarNoiseScattersThePoseWhateverTheNumberOfViews) {
  const SE3 T_c_ref(SO3::exp(Vector3(0.02, -0.03, 0.01)), Vector3(0.03, 0.02, -0.04));
  constexpr int kTrials = 40;
  std::uint32_t id = 0;
  for (const int views : {1, 2, 4}) {
    std::vector<Vector6> errors;
    Matrix6 information = Matrix6::Zero();
    for (int trial = 0; trial < kTrials; ++trial) {
      alignment_.look_at(depth(T_c_ref * T_corner_w_));
      alignment_.clear_views();
      for (int k = 0; k < views; ++k) {
        const SE3 T_view_ref(SO3::exp(Vector3(0, 0.01 * k, 0)), Vector3(0.01 * k, 0, 0));
        alignment_.add_view(KeyframeId{id++}, depth(T_view_ref * T_corner_w_), T_view_ref);
      }
      const auto placed = alignment_.align(SE3(), {});
      ASSERT_TRUE(placed) << describe(placed.error());
      errors.push_back((placed->T_c_ref * T_c_ref.inverse()).log());
      information += placed->covariance.inverse() / kTrials;
    }
    const Vector6 mean = std::accumulate(errors.begin(), errors.end(), Vector6(Vector6::Zero())) / kTrials;
    double nees = 0, with_mean = 0;
    for (const Vector6& error : errors) {
      nees += (error - mean).dot(information * (error - mean)) / (6 * (kTrials - 1));
      with_mean += error.dot(information * error) / (6 * kTrials);
    }
    std::printf("%d views: NEES / 6 %.2f about the mean, %.2f in all\n", views, nees, with_mean);
    EXPECT_GT(nees, 0.35) << views << " views";
    EXPECT_LT(nees, 0.8) << views << " views";
  }
}

TEST_F(DepthAlignmentTest, NeverGuessesAlongABareWall) {
  for (int trial = 0; trial < 20; ++trial) {
    const SE3 T_wall_w =
        SE3(SO3::exp(Vector3(0, 0, 0.1 * trial)), Vector3(0, 0, -1.5));  // one wall fills the view
    const cv::Mat first = depth(T_wall_w);
    alignment_.look_at(first);
    EXPECT_EQ(alignment_.judge_structure(), LostCause::kNoStructure) << trial;
    alignment_.look_at(depth(T_wall_w));
    alignment_.clear_views();
    alignment_.add_view(KeyframeId{static_cast<std::uint32_t>(trial)}, first, SE3());
    const auto placed = alignment_.align(SE3(), {});
    ASSERT_FALSE(placed) << trial;
    EXPECT_EQ(placed.error(), LostCause::kNoStructure) << trial;
  }
}

TEST_F(DepthAlignmentTest, NeverGuessesAlongACorridorWithoutEnds) {
  scene_ = RenderedScene(rig_, {1.2, 1.0, 500}, 3);
  const SE3 T_first_w = turned(0.1, 0.2);
  const cv::Mat first = depth(T_first_w);
  alignment_.look_at(first);
  EXPECT_EQ(alignment_.judge_structure(), LostCause::kNoStructure);
  // Half a metre along it: the walls are where they were.
  alignment_.look_at(depth(SE3(SO3(), Vector3(0, 0, -0.5)) * T_first_w));
  alignment_.add_view(KeyframeId{0}, first, SE3());
  const auto placed = alignment_.align(SE3(), {});
  ASSERT_FALSE(placed);
  EXPECT_EQ(placed.error(), LostCause::kNoStructure);
}

TEST_F(DepthAlignmentTest, AFewCornersSayWhatAWallLeavesOpen) {
  const SE3 T_wall_w(SO3(), Vector3(0, 0, -1.5));
  const SE3 T_c_w = SE3(SO3::exp(Vector3(0.01, -0.01, 0.02)), Vector3(0.03, -0.02, 0.02)) * T_wall_w;
  alignment_.look_at(depth(T_c_w));
  alignment_.add_view(KeyframeId{0}, depth(T_wall_w), SE3());
  const auto placed = alignment_.align(SE3(), corners(T_wall_w, T_c_w, 12));
  ASSERT_TRUE(placed) << describe(placed.error());
  const Vector6 error = (placed->T_c_ref * T_wall_w * T_c_w.inverse()).log();
  EXPECT_LT(error.head<3>().norm(), 0.01);
  EXPECT_LT(error.tail<3>().norm(), 0.005);
}

TEST_F(DepthAlignmentTest, RefusesWhatHasNoDepth) {
  alignment_.add_view(KeyframeId{0}, depth(T_corner_w_), SE3());
  alignment_.look_at(cv::Mat::zeros(240, 320, CV_16UC1));
  const auto placed = alignment_.align(SE3(), {});
  ASSERT_FALSE(placed);
  EXPECT_EQ(placed.error(), LostCause::kTooFewMatches);
}

/// The tracker in a room without texture.
class BareRoomTest : public DepthAlignmentTest {
 protected:
  Frame frame(int i, const SE3& T_c_w) {
    return {i, i * std::int64_t{33'000'000}, cv::Mat(240, 320, CV_8UC1, cv::Scalar(100)), {}, depth(T_c_w)};
  }
  testing::Odometry odometry_{rig_};
};

TEST_F(BareRoomTest, IsTrackedAndAllocatesNothing) {
  SE3 T_c_w = T_corner_w_;
  for (int i = 0; i < 40; ++i) {
    if (i > 0) T_c_w = SE3::exp((Vector6() << 0.008, -0.004, 0.005, 0.004, 0.008, -0.004).finished()) * T_c_w;
    const TrackResult result = odometry_.step(frame(i, T_c_w));
    ASSERT_EQ(result.status, TrackStatus::kTracking) << i << ": " << describe(result.cause);
    EXPECT_TRUE(result.by_depth) << i;
    EXPECT_EQ(odometry_.allocations(), 0U) << i;
    const SE3 T_said_first = odometry_.T_c_w(result);
    const Vector6 error = (T_said_first * T_corner_w_ * T_c_w.inverse()).log();
    EXPECT_LT(error.head<3>().norm(), 0.004) << i;
    EXPECT_LT(error.tail<3>().norm(), 0.002) << i;
  }
}

TEST_F(BareRoomTest, IsNotPlacedByShapeAloneAfterALongLoss) {
  ASSERT_EQ(odometry_.step(frame(0, T_corner_w_)).status, TrackStatus::kTracking);
  ASSERT_TRUE(odometry_.step(frame(1, T_corner_w_)).by_depth);
  Frame dark = frame(2, T_corner_w_);
  dark.depth.setTo(0);
  int lost = 0;
  for (; lost < 10; ++lost) {
    dark.index = 2 + lost;
    dark.t_ns = dark.index * std::int64_t{33'000'000};
    ASSERT_NE(odometry_.step(dark).status, TrackStatus::kTracking) << lost;
  }
  // The room is a box: another corner would fit as well.
  EXPECT_NE(odometry_.step(frame(2 + lost, T_corner_w_)).status, TrackStatus::kTracking);
}

TEST_F(BareRoomTest, IsLostHonestlyBeforeOneWall) {
  const SE3 T_wall_w(SO3(), Vector3(0, 0, -1.5));
  const TrackResult at_start = odometry_.step(frame(0, T_wall_w));
  EXPECT_EQ(at_start.status, TrackStatus::kInitialising);
  EXPECT_EQ(at_start.cause, LostCause::kNoStructure);
  ASSERT_EQ(odometry_.step(frame(1, T_corner_w_)).status, TrackStatus::kTracking);
  const TrackResult later = odometry_.step(frame(2, T_wall_w));
  EXPECT_EQ(later.status, TrackStatus::kLost);
}

/// It turns out of the corner, and on, until one wall is all that is left to see.
TEST_F(BareRoomTest, IsLostOnceOneWallIsAllThatIsLeft) {
  constexpr int kSteps = 60;
  const Vector3 way = Vector3(0.5, 0.6, 0);
  int tracked = 0, lost = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double left = 1 - static_cast<double>(i) / kSteps;
    const SE3 T_c_w(SO3::exp(left * way), Vector3(0, 0, -1.6 * (1 - left)));
    const TrackResult result = odometry_.step(frame(i, T_c_w));
    if (result.status != TrackStatus::kTracking) {
      ++lost;
      EXPECT_EQ(result.cause, LostCause::kNoStructure) << i << ": " << describe(result.cause);
      continue;
    }
    ++tracked;
    const Vector6 error = (odometry_.T_c_w(result) * T_corner_w_ * T_c_w.inverse()).log();
    EXPECT_LT(error.head<3>().norm(), 0.02) << i;
    EXPECT_LT(error.tail<3>().norm(), 0.01) << i;
  }
  EXPECT_GT(tracked, 20);
  EXPECT_GT(lost, 10);
}

}  // namespace
}  // namespace twofold
