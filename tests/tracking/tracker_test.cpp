#include "tracking/tracker.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <vector>

#include "tests/tracking/tracked_sequence.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

using namespace testing;

class TrackerTest : public ::testing::TestWithParam<SensorKind> {};

TEST_P(TrackerTest, FollowsTheCamera) {
  Odometry odometry(GetParam());
  int keyframes = 0;
  for (int i = 0; i < kFrames; ++i) {
    const TrackResult result = odometry.step(frames(GetParam())[static_cast<std::size_t>(i)]);
    ASSERT_EQ(result.status, TrackStatus::kTracking) << i << ": " << describe(result.cause);
    keyframes += result.proposed;
    const SE3 error = odometry.T_c_w(result) * true_T_c_w(i).inverse();
    EXPECT_LT(error.translation().norm(), 0.02) << i;
    EXPECT_LT(error.log().tail<3>().norm(), 0.005) << i;
    if (i > 0) {
      EXPECT_GT(result.inliers, 0.8 * result.matches) << i;
      EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix6>(result.information).eigenvalues()(0), 0);
    }
  }
  EXPECT_GT(keyframes, 3);
  EXPECT_LT(keyframes, kFrames / 2);
}

TEST_P(TrackerTest, RepeatsItselfBitForBit) {
  std::vector<TrackResult> runs[2];
  for (auto& run : runs) {
    Odometry odometry(GetParam());
    for (int i = 0; i < 15; ++i)
      run.push_back(odometry.step(frames(GetParam())[static_cast<std::size_t>(i)]));
  }
  for (std::size_t i = 0; i < runs[0].size(); ++i) {
    EXPECT_EQ(runs[0][i].reference, runs[1][i].reference);
    EXPECT_EQ(runs[0][i].inliers, runs[1][i].inliers);
    EXPECT_EQ(runs[0][i].T_c_ref.log(), runs[1][i].T_c_ref.log());
  }
}

INSTANTIATE_TEST_SUITE_P(Sensors, TrackerTest, ::testing::Values(SensorKind::kStereo, SensorKind::kRgbd),
                         [](const auto& sensor) {
                           return sensor.param == SensorKind::kStereo ? "Stereo" : "Rgbd";
                         });

TEST(Tracker, KnowsThePoseBeforeItFillsAKeyframe) {
  Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), {});
  PlainMap map;
  GraphSnapshot graph = map.publish();
  KeyframeProposal proposal;
  tracker.prepare(proposal);
  int filled = 0;
  for (const Frame& frame : frames(SensorKind::kStereo)) {
    proposal.clear();
    proposal.frame_index = -1;
    FrameStep step = tracker.locate(frame, graph, &proposal);
    ASSERT_EQ(step.result.status, TrackStatus::kTracking);
    const SE3 error = tracker.T_c_w(step) * true_T_c_w(static_cast<int>(frame.index)).inverse();
    EXPECT_LT(error.translation().norm(), 0.02);
    const bool first = frame.index == 0;  // which is a keyframe, and has no pose before
    EXPECT_TRUE(first || proposal.frame_index == -1) << "filled before anybody could be told the pose";
    const bool announced = step.result.proposed;
    tracker.prepare_next(step);
    EXPECT_EQ(step.result.proposed, announced);
    EXPECT_EQ(proposal.frame_index, announced ? frame.index : -1);
    if (!announced) continue;
    ++filled;
    map.insert(proposal);
    graph = map.publish();
  }
  EXPECT_GT(filled, 3);
}

TEST(Tracker, NeverAllocatesNotEvenForKeyframes) {
  if (!allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  const std::uint64_t before = allocations();
  const cv::Mat image(48, 64, CV_8UC1);
  ASSERT_GT(allocations(), before);
  for (const SensorKind kind : {SensorKind::kStereo, SensorKind::kRgbd}) {
    Odometry odometry(kind);
    int keyframes = 0;
    for (int i = 0; i < kFrames; ++i) {
      const TrackResult result = odometry.step(frames(kind)[static_cast<std::size_t>(i)]);
      keyframes += result.proposed;
      EXPECT_EQ(odometry.allocations(), 0u) << i << (result.proposed ? ", a keyframe" : "");
    }
    EXPECT_GT(keyframes, 2);
  }
}

TEST(Tracker, NumbersKeyframesAndPointsWithoutGaps) {
  Odometry odometry(SensorKind::kStereo);
  std::uint32_t keyframes = 0;
  std::uint32_t points = 0;
  for (const Frame& frame : frames(SensorKind::kStereo)) {
    if (!odometry.step(frame).proposed) continue;
    const KeyframeProposal& proposal = odometry.proposal();
    EXPECT_EQ(index(proposal.id), keyframes++);
    for (const ProposedPoint& point : proposal.points) {
      EXPECT_EQ(index(point.id), points++);
      EXPECT_LT(index(point.anchor), index(proposal.id));
      EXPECT_EQ(point.anchor_observation.point, point.id);
    }
    for (std::size_t i = 1; i < proposal.observations.size(); ++i) {
      EXPECT_LT(proposal.observations[i - 1].point, proposal.observations[i].point);
    }
  }
  EXPECT_GT(points, 100u);
}

TEST(Tracker, MakesNoKeyframeWithoutABuffer) {
  Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), {});
  PlainMap map;
  const GraphSnapshot empty = map.publish();
  const TrackResult result = tracker.step(frames(SensorKind::kStereo)[0], empty, nullptr);
  EXPECT_EQ(result.status, TrackStatus::kInitialising);
  EXPECT_EQ(result.cause, LostCause::kNoKeyframeBuffer);
  EXPECT_FALSE(result.proposed);
}

/// The sixth frame of a sequence.
TrackResult sixth_frame(const TrackerOptions& options) {
  Odometry odometry(test_rig(SensorKind::kStereo, 320, 240), options);
  TrackResult result;
  for (std::size_t i = 0; i < 6; ++i) result = odometry.step(frames(SensorKind::kStereo)[i]);
  return result;
}

TEST(Tracker, LooksForPointsInsideOfTheBorder) {
  TrackerOptions options;
  const int everywhere = sixth_frame(options).candidates;
  options.local_map.border_px = 60;  // 60 % and half of the image
  options.pose.min_inliers = 5;
  EXPECT_LT(sixth_frame(options).candidates, everywhere / 2);
}

TEST(Tracker, LooksForPointsFromTheSideTheyWereSeenFrom) {
  TrackerOptions options;
  options.local_map.min_view_cosine = 1;
  const TrackResult result = sixth_frame(options);
  EXPECT_EQ(result.status, TrackStatus::kLost);
  EXPECT_EQ(result.candidates, 0);
  EXPECT_EQ(result.cause, LostCause::kTooFewCandidates);
}

TEST(Tracker, StopsSearchingWhenItHasEnough) {
  TrackerOptions options;
  options.local_map.wanted_matches = 60;
  const TrackResult enough = sixth_frame(options);
  EXPECT_EQ(enough.matches, 60);
  EXPECT_LT(enough.searched, enough.candidates);
  options = {};
  options.local_map.max_searches = 50;
  EXPECT_EQ(sixth_frame(options).searched, 50);
}

/// Why the first of ten frames is lost when so many points must agree, and 60 are searched for.
LostCause first_loss(int min_inliers, TrackerOptions options = {}) {
  options.local_map.wanted_matches = 60;
  options.pose.min_inliers = min_inliers;
  options.loss.wide_search.enabled = false;
  Odometry odometry(test_rig(SensorKind::kStereo, 320, 240), options);
  for (std::size_t i = 0; i < 10; ++i) {
    const TrackResult result = odometry.step(frames(SensorKind::kStereo)[i]);
    if (result.status == TrackStatus::kLost) return result.cause;
  }
  return LostCause::kNone;
}

TEST(Tracker, IsLostWhenFewerPointsAgreeThanMust) {
  EXPECT_EQ(first_loss(60), LostCause::kNone);
  EXPECT_EQ(first_loss(61), LostCause::kTooFewMatches);
  EXPECT_EQ(first_loss(1000), LostCause::kTooFewCandidates);
  TrackerOptions strict;
  strict.pose.motion.inlier_chi2_stereo = 0.02;  // a tenth of a pixel, and no point is free of noise
  EXPECT_EQ(first_loss(60, strict), LostCause::kInconsistentMatches);
}

TEST(Tracker, IsLostWhenMostOfWhatIsFoundDisagrees) {
  TrackerOptions options;
  options.pose.motion.inlier_chi2_stereo = 0.05;
  options.pose.min_inlier_share = 0.01;
  EXPECT_EQ(first_loss(6, options), LostCause::kNone);
  options.pose.min_inlier_share = 0.95;
  EXPECT_EQ(first_loss(6, options), LostCause::kInconsistentMatches);
}

TEST(Tracker, DoesNotStartOnAnEmptyWall) {
  Frame frame = frames(SensorKind::kStereo)[0];
  frame.left = cv::Mat(240, 320, CV_8UC1, cv::Scalar(90));
  frame.right = frame.left.clone();
  Odometry odometry(SensorKind::kStereo);
  const TrackResult result = odometry.step(frame);
  EXPECT_EQ(result.status, TrackStatus::kInitialising);
  EXPECT_EQ(result.cause, LostCause::kNoTexture);
  // ... but as soon as there is something to see, with the numbers still unused.
  EXPECT_EQ(odometry.step(frames(SensorKind::kStereo)[0]).status, TrackStatus::kTracking);
  EXPECT_EQ(odometry.proposal().id, KeyframeId{0});
}

TEST(Tracker, FollowsTheCameraOnEveryEffortLevel) {
  for (int effort = 0; effort < kEffortLevels; ++effort) {
    Odometry odometry(SensorKind::kStereo);
    odometry.set_effort(static_cast<EffortLevel>(effort));
    int searched = 0;
    for (int i = 0; i < kFrames; ++i) {
      const TrackResult result = odometry.step(frames(SensorKind::kStereo)[static_cast<std::size_t>(i)]);
      ASSERT_EQ(result.status, TrackStatus::kTracking) << "effort level " << effort << ", frame " << i;
      const SE3 error = odometry.T_c_w(result) * true_T_c_w(i).inverse();
      EXPECT_LT(error.translation().norm(), 0.02) << "effort level " << effort << ", frame " << i;
      searched = std::max(searched, result.searched);
    }
    EXPECT_LE(searched, bounds_of(static_cast<EffortLevel>(effort), TrackerOptions{}).max_searches);
  }
}

TEST(Tracker, MovesAlongWhenTheMapMoves) {
  // Poses are relative to a keyframe, so a map that is turned and shifted as a whole changes nothing in them.
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  const SE3 T_v_w = SE3::exp((Vector6() << 1, 2, 3, 0.3, -0.2, 0.9).finished());
  TrackResult last[2];
  for (const bool moved : {false, true}) {
    Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), {});
    PlainMap map;
    GraphSnapshot snapshot = map.publish();
    KeyframeProposal proposal;
    for (std::size_t i = 0; i < 20; ++i) {
      last[moved] = tracker.step(sequence[i], snapshot, &proposal);
      ASSERT_EQ(last[moved].status, TrackStatus::kTracking);
      if (last[moved].proposed) map.insert(proposal);
      if (moved && i == 12) map.transform(T_v_w);
      if (last[moved].proposed || i == 12) snapshot = map.publish();
    }
  }
  EXPECT_EQ(last[0].reference, last[1].reference);
  EXPECT_EQ(last[0].inliers, last[1].inliers);
  EXPECT_LT((last[0].T_c_ref * last[1].T_c_ref.inverse()).log().norm(), 1e-6);
}

}  // namespace
}  // namespace twofold
