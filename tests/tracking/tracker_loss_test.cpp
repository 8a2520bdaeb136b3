// The tracker when it loses its way: what it says, and how it comes back.
#include <gtest/gtest.h>

#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using namespace testing;

/// A view of a room that no other test sequence shows.
Frame another_view(const SE3& T_c_w) {
  static RenderedScene scene(test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 1234);
  FrameImages images;
  scene.render(T_c_w, 2, images);
  return {0, 0, images.left.level(0).clone(), images.right.level(0).clone(), {}};
}

/// A camera that is carried to another room, starts a part there, and is recognised in the first one before
/// the mapper has the newest keyframes.
class LateMapper : public ::testing::Test {
 protected:
  /// @param keyframes  of the second part
  void go_to_another_part(int keyframes) {
    for (std::size_t i = 0; i < 20; ++i) step(frames(SensorKind::kStereo)[i]);
    for (int i = 0; i < 60 && !step(another_view(SE3())).proposed; ++i) continue;
    for (int i = 1, made = 1; i < 40 && made < keyframes; ++i)
      made += step(another_view(true_T_c_w(i))).proposed ? 1 : 0;
    waits_ = true;
    step(covered(frames(SensorKind::kStereo)[0]));
  }
  TrackResult step(Frame frame) {
    frame.index = next_++;
    frame.t_ns = frame.index * 33'000'000;
    if (!waits_) map(proposed_.size());
    KeyframeProposal& proposal = proposals_[used_];
    tracker_.prepare(proposal);
    const TrackResult result = tracker_.step(frame, snapshot_, &proposal);
    if (result.proposed) proposed_.push_back(used_++);
    return result;
  }
  void map(std::size_t proposals) {
    for (; proposals > 0; --proposals) {
      map_.insert(proposals_[proposed_.front()]);
      proposed_.erase(proposed_.begin());
    }
    snapshot_ = map_.publish();
  }
  /// The camera is back in the first room, and goes on there.
  void expect_that_it_stays_in_the_first_part() {
    tracker_.relocalise(KeyframeId{0}, true_T_c_w(2));
    ASSERT_EQ(step(frames(SensorKind::kStereo)[2]).status, TrackStatus::kTracking);
    ASSERT_FALSE(proposed_.empty());
    map(1);  // the newest keyframe of the other part
    for (std::size_t i = 3; i < 12; ++i) {
      const TrackResult found = step(frames(SensorKind::kStereo)[i]);
      ASSERT_EQ(found.status, TrackStatus::kTracking) << i << " " << describe(found.cause);
      waits_ = false;
      map(proposed_.size());
      EXPECT_EQ(snapshot_.part(found.reference), KeyframeId{0}) << i;
      const SE3 T_c_w = found.T_c_ref * snapshot_.T_k_w(found.reference);
      EXPECT_LT((T_c_w * true_T_c_w(static_cast<int>(i)).inverse()).translation().norm(), 0.02) << i;
    }
    for (std::uint32_t k = 0; k < snapshot_.keyframe_count(); ++k)
      for (const Observation& seen : *snapshot_.keyframe(KeyframeId{k}).observations)
        ASSERT_EQ(snapshot_.part(snapshot_.point(seen.point).anchor), snapshot_.part(KeyframeId{k})) << k;
  }

  Tracker tracker_{test_rig(SensorKind::kStereo, 320, 240), TrackerOptions{}};
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  std::vector<KeyframeProposal> proposals_{64};
  std::size_t used_ = 0;
  std::vector<std::size_t> proposed_;  ///< and not in the map yet
  std::int64_t next_ = 0;
  bool waits_ = false;  ///< the mapper, with what was proposed
};

TEST_F(LateMapper, DoesNotTakeTheCameraToAPartThatItHasLeft) {
  go_to_another_part(2);
  ASSERT_EQ(proposed_.size(), 1u);
  expect_that_it_stays_in_the_first_part();
}

TEST_F(LateMapper, MayGetToKnowAPartAfterTheCameraHasLeftIt) {
  go_to_another_part(1);
  ASSERT_EQ(proposed_.size(), 1u);
  expect_that_it_stays_in_the_first_part();
}

/// The right image so many rows lower.
Frame with_rows_shifted(const Frame& frame, int rows) {
  Frame shifted = frame;
  shifted.right = frame.right.clone();
  for (int v = 0; v < frame.right.rows; ++v)
    frame.right.row(std::clamp(v - rows, 0, frame.right.rows - 1)).copyTo(shifted.right.row(v));
  return shifted;
}

TEST(Tracker, FindsOnAfterAStepTooWideForItsPrediction) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 15; ++i) odometry.step(sequence[i]);
  const SE3 T_c_w = SE3(SO3::exp(Vector3(0.04, 0.25, 0.03)), Vector3(0.1, 0, -0.1)) * true_T_c_w(14);
  RenderedScene scene(test_rig(SensorKind::kStereo, 320, 240), {3, 2, 5}, 21);
  FrameImages images;
  scene.render(T_c_w, 2, images);
  const Frame frame{15, 900'000'000, images.left.level(0).clone(), images.right.level(0).clone(), {}};
  const TrackResult found = odometry.step(frame);
  EXPECT_EQ(odometry.allocations(), 0u);
  ASSERT_EQ(found.status, TrackStatus::kTracking) << describe(found.cause);
  EXPECT_LT((odometry.T_c_w(found) * T_c_w.inverse()).translation().norm(), 0.02);
}

/// A turning camera, every third frame on whose way is followed by so many that are missing.
int lost_where_frames_are_missing(int missing) {
  TrackerOptions options;
  options.loss.wide_search.enabled = false;  // the prediction alone
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  Odometry odometry(rig, options);
  RenderedScene scene(rig, {3, 2, 5}, 21);
  int lost = 0, now = 0;
  for (int i = 0; i < 24; ++i) {
    const SE3 T_c_w(SO3::exp(Vector3(0, 0.8 * std::sin(0.12 * now), 0)),
                    Vector3(0.02 * std::sin(0.1 * now), 0, 0));
    FrameImages images;
    scene.render(T_c_w, 2, images);
    const TrackResult result = odometry.step(
        {i, now * std::int64_t{50'000'000}, images.left.level(0).clone(), images.right.level(0).clone(), {}});
    lost += result.status == TrackStatus::kTracking ? 0 : 1;
    now += 1 + (i >= 10 && i % 3 == 0 ? missing : 0);
  }
  return lost;
}

TEST(Tracker, GoesOnAsFastAsItMovedWhereFramesAreMissing) {
  EXPECT_EQ(lost_where_frames_are_missing(0), 0);
  EXPECT_EQ(lost_where_frames_are_missing(2), 0);
}

TEST(Tracker, FindsBackToWhatOnlyAnOlderKeyframeShows) {
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene(rig, {3, 2, 5}, 21);
  Odometry odometry(rig);
  int index = 0;
  const auto step = [&](double yaw) {
    FrameImages images;
    scene.render(SE3(SO3::exp(Vector3(0, yaw, 0)), Vector3::Zero()), 2, images);
    const std::int64_t t_ns = index * std::int64_t{33'000'000};
    return odometry.step({index++, t_ns, images.left.level(0).clone(), images.right.level(0).clone(), {}});
  };
  for (int i = 0; i <= 25; ++i) ASSERT_NE(step(0.06 * i).status, TrackStatus::kLost) << i;
  const TrackResult found = step(0.18);  // the fourth keyframe back shows it
  EXPECT_EQ(odometry.allocations(), 0u);
  ASSERT_EQ(found.status, TrackStatus::kTracking) << describe(found.cause);
  EXPECT_LT((odometry.T_c_w(found).so3().log() - Vector3(0, 0.18, 0)).norm(), 0.01);
}

TEST(Tracker, StartsNoPartForAFewLostFramesHoweverLongTheyTake) {
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 15; ++i) odometry.step(frames(SensorKind::kStereo)[i]);
  Frame elsewhere = another_view(SE3());
  for (int i = 0; i < TrackerOptions{}.loss.new_part_frames; ++i) {
    elsewhere.index = 15 + i;
    elsewhere.t_ns = (10 + 3 * i) * std::int64_t{1'000'000'000};  // three seconds apart
    EXPECT_EQ(odometry.step(elsewhere).status,
              i + 1 < TrackerOptions{}.loss.new_part_frames ? TrackStatus::kLost : TrackStatus::kTracking)
        << i;
  }
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
  if (!allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 35; ++i) odometry.step(sequence[i]);
  const Frame dark = covered(sequence[35]);
  ASSERT_EQ(odometry.step(dark).status, TrackStatus::kLost);
  EXPECT_EQ(odometry.allocations(), 0u);
  const std::uint64_t before = allocations();
  odometry.tracker().relocalise(KeyframeId{0}, true_T_c_w(2));
  EXPECT_EQ(allocations(), before);
  ASSERT_EQ(odometry.step(sequence[2]).status, TrackStatus::kTracking);
  EXPECT_EQ(odometry.allocations(), 0u);
  // Carried elsewhere, and nobody says so: a new part is started after a while.
  const Frame other = another_view(SE3());
  bool started = false;
  for (int i = 0; i < 40 && !started; ++i) {
    Frame frame = other;
    frame.index = 100 + i;
    frame.t_ns = 10'000'000'000 + i * std::int64_t{33'000'000};
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(odometry.allocations(), 0u) << i;
    started = result.proposed;
  }
  EXPECT_TRUE(started);
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

TEST(Tracker, SaysWhatIsWrongWithThePair) {
  const Frame& good = frames(SensorKind::kStereo)[0];
  const auto cause_of = [](const Frame& frame) { return Odometry(SensorKind::kStereo).step(frame).cause; };
  EXPECT_EQ(cause_of(good), LostCause::kNone);
  Frame swapped = good;
  std::swap(swapped.left, swapped.right);
  EXPECT_EQ(cause_of(swapped), LostCause::kImagesSwapped);
  Frame covered = good;
  covered.right = cv::Mat(good.right.size(), CV_8UC1, cv::Scalar(9));
  EXPECT_EQ(cause_of(covered), LostCause::kRightCovered);
  for (const int shift : {-8, -6, 6, 8})
    EXPECT_EQ(cause_of(with_rows_shifted(good, shift)), LostCause::kRowsMisaligned) << shift;
}

TEST(Tracker, TakesBackRowsThatAreSomeApart) {
  for (const int shift : {-4, -2, -1, 0, 1, 2, 3}) {
    Odometry odometry(SensorKind::kStereo);
    for (std::size_t i = 0; i < 20; ++i) {
      const TrackResult result = odometry.step(with_rows_shifted(frames(SensorKind::kStereo)[i], shift));
      EXPECT_EQ(odometry.allocations(), 0u) << shift << ", frame " << i;
      ASSERT_EQ(result.status, TrackStatus::kTracking) << shift << ", frame " << i;
      EXPECT_LT((odometry.T_c_w(result) * true_T_c_w(static_cast<int>(i)).inverse()).translation().norm(),
                0.02)
          << shift << ", frame " << i;
    }
    EXPECT_NEAR(odometry.tracker().row_offset(), shift, 0.13);
  }
}

/// Half a turn away a box of a room has the same shape: after a loss its surfaces fit there as well, and what
/// is on the walls tells.
TEST(Tracker, TakesNoPlaceForAnotherOfTheSameShape) {
  const Rig rig = test_rig(SensorKind::kRgbd, 320, 240);
  RenderedScene scene(rig, {3, 2, 3}, 21);
  Odometry odometry(rig);
  std::int64_t index = 0;
  const auto step = [&](const SE3& T_c_w, bool dark, bool covered) {
    FrameImages images;
    scene.render(T_c_w, 2, images);
    Frame frame{index, index * std::int64_t{33'000'000}, images.left.level(0).clone(), {}, images.depth};
    if (dark) frame.left.setTo(3);
    if (covered) frame.depth.setTo(0);
    ++index;
    return odometry.step(frame);
  };
  // Down into a corner; steps aside end in the middle of the room.
  const auto at = [](double turned, double aside) {
    return SE3(SO3::exp(Vector3(0.5, 0, 0)) * SO3::exp(Vector3(0, turned, 0)), Vector3(aside, 0, 0));
  };
  constexpr int kSteps = 30;
  for (int i = 0; i <= kSteps; ++i) {
    const TrackResult tracked = step(at(0.5 + 0.01 * i, 0.02 * (i - kSteps)), false, false);
    ASSERT_EQ(tracked.status, TrackStatus::kTracking) << i;
  }
  const SE3 T_last_w = at(0.8, 0);
  const TrackResult by_depth = step(T_last_w, true, false);  // the light goes out
  ASSERT_EQ(by_depth.status, TrackStatus::kTracking) << describe(by_depth.cause);
  ASSERT_TRUE(by_depth.by_depth);
  ASSERT_EQ(step(T_last_w, true, true).status, TrackStatus::kLost);
  const TrackResult elsewhere = step(at(0.8 + M_PI, 0), false, false);
  EXPECT_EQ(elsewhere.status, TrackStatus::kLost) << elsewhere.candidates << " candidates";
  const TrackResult back = step(T_last_w, false, false);
  ASSERT_EQ(back.status, TrackStatus::kTracking) << describe(back.cause);
  const SE3 T_c_first = T_last_w * at(0.5, -0.02 * kSteps).inverse();
  EXPECT_LT((odometry.T_c_w(back) * T_c_first.inverse()).translation().norm(), 0.03);
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
  // The camera is put back to the start.
  const SE3 wrong(SO3::exp(Vector3(0, 1.5, 0)), Vector3::Zero());
  odometry.tracker().relocalise(KeyframeId{0}, wrong * true_T_c_w(2));
  const TrackResult doubted = odometry.step(sequence[2]);
  if (doubted.status == TrackStatus::kTracking) {  // found without the hint
    EXPECT_LT((odometry.T_c_w(doubted) * true_T_c_w(2).inverse()).translation().norm(), 0.01);
    odometry.step(covered(sequence[35]));
  }
  const SE3 off(SO3::exp(Vector3(0.01, -0.01, 0)), Vector3::Zero());
  odometry.tracker().relocalise(KeyframeId{0}, off * true_T_c_w(2));
  const TrackResult found = odometry.step(sequence[2]);
  ASSERT_EQ(found.status, TrackStatus::kTracking);
  EXPECT_LT((odometry.T_c_w(found) * true_T_c_w(2).inverse()).translation().norm(), 0.01);
  EXPECT_EQ(odometry.step(sequence[3]).status, TrackStatus::kTracking);
}

/// A camera in a map that another one made, told about where it is.
TrackStatus told_where_it_is(TrackerOptions options) {
  options.loss.wide_search.enabled = false;
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  static const GraphSnapshot map = [&] {
    Odometry odometry(SensorKind::kStereo);
    for (std::size_t i = 0; i < 20; ++i) odometry.step(sequence[i]);
    return odometry.snapshot();
  }();
  Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), options);
  tracker.continue_from(map);
  KeyframeProposal proposal;
  tracker.prepare(proposal);
  EXPECT_EQ(tracker.step(sequence[1], map, &proposal).status, TrackStatus::kLost);
  const SE3 off(SO3::exp(Vector3(0.01, -0.01, 0)), Vector3::Zero());
  tracker.relocalise(KeyframeId{0}, off * true_T_c_w(2));
  return tracker.step(sequence[2], map, &proposal).status;
}

TEST(Tracker, BelievesAnAnswerThatEnoughOfTheMapsPointsSupport) {
  EXPECT_EQ(told_where_it_is({}), TrackStatus::kTracking);
  TrackerOptions options;
  options.pose.rough.min_inliers = 10'000;
  EXPECT_EQ(told_where_it_is(options), TrackStatus::kTracking) << "points that the map has will do";
  options.pose.rough.min_mapped = 10'000;
  EXPECT_EQ(told_where_it_is(options), TrackStatus::kLost);
  options = {};
  options.pose.rough.searched_share = 1;
  EXPECT_EQ(told_where_it_is(options), TrackStatus::kLost) << "some of those searched are not found";
  options = {};
  options.pose.motion.inlier_chi2_stereo = 0.1;
  options.pose.min_inliers = 6;
  options.pose.rough.min_mapped = 6;
  options.pose.min_inlier_share = options.pose.rough.inlier_share = options.pose.rough.searched_share = 0.01;
  EXPECT_EQ(told_where_it_is(options), TrackStatus::kTracking);
  options.pose.rough.inlier_share = 1;
  EXPECT_EQ(told_where_it_is(options), TrackStatus::kLost) << "some of those found do not agree";
}

/// In a map of before, said to be where it is, but for `off`: the frame with which it is tracked; -1: never.
int placed_after(const SE3& off, double angle_sigma, EffortLevel effort = EffortLevel::kEverything) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  for (std::size_t i = 0; i < 20; ++i) odometry.step(sequence[i]);
  const GraphSnapshot& map = odometry.snapshot();
  Tracker tracker(test_rig(SensorKind::kStereo, 320, 240), {});
  tracker.continue_from(map, AssumedPose{kNoKeyframe, (off * true_T_c_w(2)).inverse(), 0, angle_sigma});
  for (int n = 0; n < 30; ++n) {
    Frame frame = sequence[2];
    frame.index = n;
    frame.t_ns = n * std::int64_t{33'000'000};
    const std::uint64_t before = allocations();
    const TrackResult result = tracker.step(frame, map, nullptr, effort);
    EXPECT_EQ(allocations(), before);
    if (result.status != TrackStatus::kTracking) {
      EXPECT_EQ(result.cause, LostCause::kUnplaced);
      continue;
    }
    EXPECT_FALSE(tracker.unplaced());
    EXPECT_LT((result.T_c_ref * map.T_k_w(result.reference) * true_T_c_w(2).inverse()).log().norm(), 0.01);
    return n;
  }
  return -1;
}

TEST(Tracker, IsPlacedWithTheFirstFrameWhereItIsSaidToBe) {
  EXPECT_EQ(placed_after(SE3(), 0), 0);
  EXPECT_EQ(placed_after({SO3::exp(Vector3(0.01, -0.01, 0)), Vector3(0.01, 0, 0)}, 0), 0);
}

TEST(Tracker, IsLookedForAroundWhereItIsSaidToBe) {
  const SE3 off(SO3::exp(Vector3(0.06, -0.08, 0)), Vector3::Zero());
  EXPECT_EQ(placed_after(off, 0), -1) << "too far away, and nobody said that it may be";
  const int found = placed_after(off, 0.06);
  EXPECT_GT(found, 0);
}

TEST(Tracker, IsNotPlacedWhereItIsNot) {
  EXPECT_EQ(placed_after({SO3::exp(Vector3(0, 0.8, 0)), Vector3::Zero()}, 0.02), -1);
}

/// An answer that comes when the camera has been found without it is about a frame long past.
TEST(Tracker, WhileItKnowsItsWayNoAnswerMovesIt) {
  const std::vector<Frame>& sequence = frames(SensorKind::kStereo);
  Odometry odometry(SensorKind::kStereo);
  TrackResult before;
  for (std::size_t i = 0; i < 30; ++i) before = odometry.step(sequence[i]);
  ASSERT_NE(before.reference, KeyframeId{0});
  odometry.tracker().relocalise(KeyframeId{0}, true_T_c_w(30));
  EXPECT_NE(odometry.step(sequence[30]).reference, KeyframeId{0});
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

}  // namespace
}  // namespace twofold
