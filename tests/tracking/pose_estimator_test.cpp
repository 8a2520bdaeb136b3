// A pose from points that were found, and what that says about them.
#include "tracking/pose/pose_estimator.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_scene.hpp"
#include "geometry/inverse_depth.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr KeyframeId kFirst{0};

class PoseEstimatorTest : public ::testing::Test {
 protected:
  PoseEstimatorTest() {
    immature_.add_pending({kFirst, kNoKeyframe, SE3()});
    for (int i = 0; i < 60; ++i) {
      ImmaturePoint point;
      point.anchor = kFirst;
      point.psi = to_inverse_depth(Vector3(-1 + 0.25 * (i % 10), -0.7 + 0.25 * (i / 10), 2 + i % 7));
      immature_.add(point);
    }
    local_map_.update(snapshot_, kFirst, immature_, 20);
    step_.result.candidates = 60;
  }
  /// The first `count` points, where a camera at T_c_ref sees them.
  void find(int count, const SE3& T_c_ref) {
    found_.clear();
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(count); ++i) {
      const Vector3 x_c = T_c_ref * local_map_.points()[i].x_ref;
      const Vector2 uv = rig_.camera.project(x_c);
      PointMatch match{};
      match.pixel = {uv.x(), uv.y(), uv.x() - rig_.camera.fx * rig_.baseline / x_c.z()};
      found_.matches.push_back({i, match});
    }
    step_.result.matches = step_.result.searched = count;
  }
  /// Of the first points, seen elsewhere than they should be.
  void displace(int count) {
    for (int m = 0; m < count; ++m) found_.matches[static_cast<std::size_t>(m)].found.pixel.y() += 15;
  }
  LostCause estimate() { return estimator_.estimate({kFirst, SE3()}, step_, found_); }

  const Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  const TrackerOptions options_;
  const SE3 T_true_{SO3::exp(Vector3(0.01, -0.02, 0.005)), Vector3(0.05, -0.02, 0.1)};
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  Frame frame_;
  FrameStep step_{frame_, snapshot_, nullptr, bounds_of(EffortLevel::kEverything, options_), 0};
  MotionModel motion_{options_.motion_model};
  ShutterModel shutter_{rig_, motion_, 100};
  ImmaturePoints immature_{100, 4};
  LocalMap local_map_{100};
  PoseEstimator estimator_{rig_, options_, local_map_, shutter_, immature_};
  SearchOutcome found_{rig_, options_.local_map.max_searches};
};

TEST_F(PoseEstimatorTest, FindsWhereAllPointsAreSeenFrom) {
  find(60, T_true_);
  ASSERT_EQ(estimate(), LostCause::kNone);
  EXPECT_EQ(step_.result.status, TrackStatus::kTracking);
  EXPECT_EQ(step_.result.reference, kFirst);
  EXPECT_EQ(step_.result.inliers, 60);
  EXPECT_LT((step_.result.T_c_ref * T_true_.inverse()).log().norm(), 1e-4);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(step_.result.information).eigenvalues()(0), 0);
}

TEST_F(PoseEstimatorTest, GivesNoPoseWhereTooLittleWasFoundOrTooFewAgree) {
  find(options_.pose.min_inliers - 1, T_true_);
  EXPECT_EQ(estimate(), LostCause::kTooFewMatches);
  step_.result.candidates = options_.pose.min_inliers - 1;
  EXPECT_EQ(estimate(), LostCause::kTooFewCandidates);
  step_.result.candidates = 60;
  find(60, T_true_);
  for (std::size_t m = 0; m < 60; ++m)
    found_.matches[m].found.pixel.y() += static_cast<double>(m * 37 % 60) - 30;
  EXPECT_EQ(estimate(), LostCause::kInconsistentMatches);
  EXPECT_NE(step_.result.status, TrackStatus::kTracking);
}

TEST_F(PoseEstimatorTest, KnowsWhichOfTheTrackersPointsMoveOrAreNotFound) {
  for (int times = 1; times <= options_.immature.moving_after; ++times) {
    find(50, T_true_);
    displace(3);
    for (std::uint32_t i = 50; i < 60; ++i) found_.missed.push_back(i);
    ASSERT_EQ(estimate(), LostCause::kNone);
    EXPECT_EQ(step_.result.inliers, 47);
    EXPECT_EQ(step_.result.moving, times < options_.immature.moving_after ? 0 : 3);
    EXPECT_EQ(immature_.points()[0].moved, times);
    EXPECT_EQ(immature_.points()[0].agreed, 0);
    EXPECT_EQ(immature_.points()[10].agreed, times);
    EXPECT_EQ(immature_.points()[55].failures, times);
  }
  find(60, T_true_);
  ASSERT_EQ(estimate(), LostCause::kNone);
  EXPECT_EQ(immature_.points()[0].moved, 0);
  EXPECT_EQ(immature_.points()[55].failures, 0);
}

/// None of these points is of the map: many must be found, and of those searched not too few.
TEST_F(PoseEstimatorTest, BelievesARoughStartOnlyWithMuchBehindIt) {
  find(options_.pose.rough.min_inliers, T_true_);
  ASSERT_EQ(estimate(), LostCause::kNone);
  EXPECT_TRUE(estimator_.well_supported(step_.result, found_));
  step_.result.searched =
      static_cast<int>(options_.pose.rough.min_inliers / options_.pose.rough.searched_share) + 5;
  EXPECT_FALSE(estimator_.well_supported(step_.result, found_));
  find(options_.pose.rough.min_inliers - 1, T_true_);
  ASSERT_EQ(estimate(), LostCause::kNone);
  EXPECT_FALSE(estimator_.well_supported(step_.result, found_));
}

}  // namespace
}  // namespace twofold
