#include "tracking/tracker.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "../../bench/tracking/plain_map.hpp"
#include "../imaging/rendered_scene.hpp"
#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

using testing::RenderedScene;
using testing::test_rig;

constexpr int kFrames = 40;

/// Along a gentle curve, looking about.
SE3 T_c_w_at(int i) {
  const double s = 0.03 * i;
  const SE3 T_w_c(SO3::exp(Vector3(0.05 * std::sin(3 * s), 0.25 * std::sin(1.5 * s), 0.04 * std::sin(4 * s))),
                  Vector3(0.5 * std::sin(s), 0.1 * std::sin(2 * s), s));
  return T_w_c.inverse();
}

/// Rendered once for all tests of a sensor.
const std::vector<Frame>& frames(SensorKind kind) {
  static std::array<std::vector<Frame>, 3> all;
  std::vector<Frame>& result = all[static_cast<std::size_t>(kind)];
  if (!result.empty()) return result;
  RenderedScene scene(test_rig(kind, 320, 240), {3, 2, 5}, 21);
  for (int i = 0; i < kFrames; ++i) {
    FrameImages images;
    scene.render(T_c_w_at(i) * T_c_w_at(0).inverse(), 2, images);
    Frame frame{i, i * std::int64_t{33'000'000}, images.left.level(0).clone(), {}, images.depth.clone()};
    if (kind == SensorKind::kStereo) frame.right = images.right.level(0).clone();
    result.push_back(frame);
  }
  return result;
}

SE3 true_T_c_w(int i) {
  return T_c_w_at(i) * T_c_w_at(0).inverse();
}

/// Tracker and map in lockstep.
class Odometry {
 public:
  explicit Odometry(SensorKind kind) : tracker_(test_rig(kind, 320, 240), {}) { tracker_.prepare(proposal_); }

  TrackResult step(const Frame& frame) {
    if (pending_) map_.insert(proposal_);
    if (pending_) snapshot_ = map_.publish();
    pending_ = false;
    const std::uint64_t before = testing::allocations();
    const TrackResult result = tracker_.step(frame, snapshot_, &proposal_, rung_);
    allocations_ = testing::allocations() - before;
    pending_ = result.proposed;
    return result;
  }
  /// The last result's pose in the world.
  [[nodiscard]] SE3 T_c_w(const TrackResult& result) const {
    if (snapshot_.contains(result.reference)) return result.T_c_ref * snapshot_.T_k_w(result.reference);
    return result.T_c_ref;  // the first keyframe is the world
  }
  Tracker& tracker() { return tracker_; }
  void set_rung(LadderRung rung) { rung_ = rung; }
  [[nodiscard]] const GraphSnapshot& snapshot() const { return snapshot_; }
  [[nodiscard]] const KeyframeProposal& proposal() const { return proposal_; }
  [[nodiscard]] std::uint64_t allocations() const { return allocations_; }  ///< of the tracker, last step

 private:
  Tracker tracker_;
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  KeyframeProposal proposal_;
  bool pending_ = false;
  LadderRung rung_ = LadderRung::kEverything;
  std::uint64_t allocations_ = 0;
};

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

TEST(Tracker, NeverAllocatesNotEvenForKeyframes) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  const std::uint64_t before = testing::allocations();
  const cv::Mat image(48, 64, CV_8UC1);
  ASSERT_GT(testing::allocations(), before);
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
    for (const NewPoint& point : proposal.new_points) {
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

TEST(Tracker, TakesNumbersBackWhenAProposalWasRejected) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), {});
  PlainMap map;
  GraphSnapshot snapshot = map.publish();
  KeyframeProposal proposal;
  std::uint32_t keyframes = 0;
  std::uint32_t points = 0;
  int rejected = 0;
  for (const Frame& frame : sequence) {
    const TrackResult result = tracker.step(frame, snapshot, &proposal);
    if (!result.proposed) continue;
    EXPECT_EQ(index(proposal.id), keyframes);
    if (!proposal.new_points.empty()) {
      EXPECT_EQ(index(proposal.new_points.front().id), points);
    }
    if (frame.index % 2 == 1) {  // the ring is full every other frame
      tracker.proposal_rejected();
      ++rejected;
      continue;
    }
    ++keyframes;
    points += static_cast<std::uint32_t>(proposal.new_points.size());
    map.insert(proposal);
    snapshot = map.publish();
  }
  EXPECT_GT(rejected, 1);
  EXPECT_GT(keyframes, 2u);
  EXPECT_EQ(snapshot.keyframe_count(), keyframes);
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

Frame covered(const Frame& frame) {
  Frame dark = frame;
  dark.left = cv::Mat(frame.left.rows, frame.left.cols, CV_8UC1, cv::Scalar(3));
  dark.right = dark.left.clone();
  return dark;
}

TEST(Tracker, SaysThatItIsLostAndWhyAndComesBack) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 15; ++i) odometry.step(sequence[i]);
  for (std::size_t i = 15; i < 18; ++i) {
    const TrackResult lost = odometry.step(covered(sequence[i]));
    EXPECT_EQ(lost.status, TrackStatus::kLost);
    EXPECT_EQ(lost.cause, LostCause::kCovered);
    EXPECT_EQ(lost.inliers, 0);
    EXPECT_FALSE(lost.proposed);
  }
  const TrackResult found = odometry.step(sequence[18]);
  ASSERT_EQ(found.status, TrackStatus::kTracking);
  EXPECT_LT((odometry.T_c_w(found) * true_T_c_w(18).inverse()).translation().norm(), 0.02);
}

TEST(Tracker, NeverAllocatesWhenLostOrRelocalisedOrStartingAPart) {
  if (!testing::allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 35; ++i) odometry.step(sequence[i]);
  const Frame dark = covered(sequence[35]);
  ASSERT_EQ(odometry.step(dark).status, TrackStatus::kLost);
  EXPECT_EQ(odometry.allocations(), 0u);
  const std::uint64_t before = testing::allocations();
  odometry.tracker().relocalise(KeyframeId{0}, true_T_c_w(2));
  EXPECT_EQ(testing::allocations(), before);
  ASSERT_EQ(odometry.step(sequence[2]).status, TrackStatus::kTracking);
  EXPECT_EQ(odometry.allocations(), 0u);
  // Carried to the start again, and nobody says so: a new part is started after a while.
  for (std::size_t i = 3; i < 35; ++i) odometry.step(sequence[i]);
  bool started = false;
  for (int i = 0; i < 40 && !started; ++i) {
    Frame frame = sequence[2];
    frame.index = 100 + i;
    frame.t_ns = 10'000'000'000 + i * std::int64_t{33'000'000};
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(odometry.allocations(), 0u) << i;
    started = result.proposed;
  }
  EXPECT_TRUE(started);
}

TEST(Tracker, FollowsTheCameraOnEveryRungOfTheLadder) {
  for (int rung = 0; rung < kLadderRungs; ++rung) {
    Odometry odometry(SensorKind::kStereo);
    odometry.set_rung(static_cast<LadderRung>(rung));
    int searched = 0;
    for (int i = 0; i < kFrames; ++i) {
      const TrackResult result = odometry.step(frames(SensorKind::kStereo)[static_cast<std::size_t>(i)]);
      ASSERT_EQ(result.status, TrackStatus::kTracking) << "rung " << rung << ", frame " << i;
      const SE3 error = odometry.T_c_w(result) * true_T_c_w(i).inverse();
      EXPECT_LT(error.translation().norm(), 0.02) << "rung " << rung << ", frame " << i;
      searched = std::max(searched, result.searched);
    }
    EXPECT_LE(searched, effort_on(static_cast<LadderRung>(rung), TrackerOptions{}).max_searches);
  }
}

TEST(Tracker, DoesNotInventAPoseInAnotherPlace) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 15; ++i) odometry.step(sequence[i]);
  RenderedScene other(test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 1234);
  for (int i = 0; i < 5; ++i) {
    FrameImages images;
    other.render(true_T_c_w(15 + i), 2, images);
    Frame frame = sequence[static_cast<std::size_t>(15 + i)];
    frame.left = images.left.level(0).clone();
    frame.right = images.right.level(0).clone();
    EXPECT_EQ(odometry.step(frame).status, TrackStatus::kLost) << i;
  }
}

TEST(Tracker, SaysThatItIsLostForWhatWasMissedBefore) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  const auto cause_after = [&](std::int64_t missing, std::int64_t gap_ns) {
    Odometry odometry(SensorKind::kStereo);
    for (std::size_t i = 0; i < 15; ++i) odometry.step(sequence[i]);
    // Turned far away meanwhile.
    RenderedScene scene(test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 21);
    FrameImages images;
    scene.render(SE3(SO3::exp(Vector3(0, 1.2, 0)), Vector3::Zero()) * true_T_c_w(14), 2, images);
    Frame frame = sequence[15];
    frame.index += missing;
    frame.t_ns += gap_ns;
    frame.left = images.left.level(0).clone();
    frame.right = images.right.level(0).clone();
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(result.status, TrackStatus::kLost);
    return result.cause;
  };
  EXPECT_EQ(cause_after(20, 700'000'000), LostCause::kFramesMissing);
  EXPECT_EQ(cause_after(0, 700'000'000), LostCause::kGapInTime);
  const LostCause neither = cause_after(0, 0);
  EXPECT_TRUE(neither == LostCause::kTooFewMatches || neither == LostCause::kTooFewCandidates)
      << describe(neither);
}

TEST(Tracker, GoesWhereItIsRelocalised) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 35; ++i) odometry.step(sequence[i]);
  odometry.step(covered(sequence[35]));
  // The camera is put back to the start: too far for the last good frame to help.
  ASSERT_EQ(odometry.step(sequence[2]).status, TrackStatus::kLost);
  const SE3 wrong(SO3::exp(Vector3(0, 1.5, 0)), Vector3::Zero());
  odometry.tracker().relocalise(KeyframeId{0}, wrong * true_T_c_w(2));
  EXPECT_EQ(odometry.step(sequence[2]).status, TrackStatus::kLost);
  const SE3 off(SO3::exp(Vector3(0.01, -0.01, 0)), Vector3::Zero());
  odometry.tracker().relocalise(KeyframeId{0}, off * true_T_c_w(2));
  const TrackResult found = odometry.step(sequence[2]);
  ASSERT_EQ(found.status, TrackStatus::kTracking);
  EXPECT_LT((odometry.T_c_w(found) * true_T_c_w(2).inverse()).translation().norm(), 0.01);
  EXPECT_EQ(odometry.step(sequence[3]).status, TrackStatus::kTracking);
}

TEST(Tracker, IsPlacedExactlyByAnAnswerThatIsAStepOld) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 35; ++i) odometry.step(sequence[i]);
  odometry.step(covered(sequence[35]));
  // A car's step: near points are beyond the radius of the search, far ones alone would leave it 5 cm off.
  const SE3 moved_since(SO3(), Vector3(0.27, 0.09, 0.9));
  odometry.tracker().relocalise(KeyframeId{0}, moved_since * true_T_c_w(2));
  const TrackResult found = odometry.step(sequence[2]);
  ASSERT_EQ(found.status, TrackStatus::kTracking);
  EXPECT_LT((odometry.T_c_w(found) * true_T_c_w(2).inverse()).translation().norm(), 0.01);
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
