// The tracker with one camera: when it starts, what it waits for, and that it then follows the camera up to
// scale.
#include <gtest/gtest.h>

#include <functional>
#include <vector>

#include "fixtures/corner_walk.hpp"
#include "geometry/absolute_orientation.hpp"
#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using namespace testing;

/// Left images of a walk through the room.
std::vector<Frame> walk(const std::function<SE3(int i)>& T_c_w, int count, std::uint32_t room = 21) {
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  RenderedScene scene(rig, {3, 2, 5}, room);
  std::vector<Frame> frames;
  for (int i = 0; i < count; ++i)
    frames.push_back({i, i * std::int64_t{33'000'000}, scene.render_one(T_c_w(i), 2), {}, {}});
  return frames;
}

const std::vector<Frame>& before_the_corner() {
  static const std::vector<Frame> frames = walk(corner_walk, kFrames);
  return frames;
}

TEST(TrackerOneCamera, FollowsTheCameraUpToScale) {
  Odometry odometry(SensorKind::kMono);
  std::vector<Vector3> estimated, truth;
  int lost_after_start = 0, keyframes = 0;
  for (int i = 0; i < kFrames; ++i) {
    const TrackResult result = odometry.step(before_the_corner()[static_cast<std::size_t>(i)]);
    keyframes += result.proposed;
    if (result.status != TrackStatus::kTracking) {
      lost_after_start += !estimated.empty();
      continue;
    }
    estimated.push_back(odometry.T_c_w(result).inverse().translation());
    truth.push_back(corner_walk(i).inverse().translation());
  }
  ASSERT_GT(estimated.size(), 20u);
  EXPECT_EQ(lost_after_start, 0);
  EXPECT_GT(keyframes, 2);
  const auto S = align_similarity(truth, estimated);
  ASSERT_TRUE(S);
  for (std::size_t n = 0; n < truth.size(); ++n) EXPECT_LT((*S * estimated[n] - truth[n]).norm(), 0.02) << n;
}

TEST(TrackerOneCamera, AllocatesNothingOnceItHasStarted) {
  if (!allocations_are_counted()) GTEST_SKIP() << "the sanitizer has its own allocator";
  Odometry odometry(SensorKind::kMono);
  bool started = false;
  for (const Frame& frame : before_the_corner()) {
    const bool tracked = odometry.step(frame).status == TrackStatus::kTracking;
    if (started) {
      EXPECT_EQ(odometry.allocations(), 0u) << frame.index;
    }
    started = started || tracked;
  }
  EXPECT_TRUE(started);
}

TEST(TrackerOneCamera, StartsTheSameInEveryRun) {
  TrackResult first[2];
  for (TrackResult& result : first) {
    Odometry odometry(SensorKind::kMono);
    for (const Frame& frame : before_the_corner()) {
      result = odometry.step(frame);
      if (result.status == TrackStatus::kTracking) break;
    }
  }
  EXPECT_EQ(first[0].T_c_ref.log(), first[1].T_c_ref.log());
  EXPECT_GT(first[0].T_c_ref.translation().norm(), 0);
}

TEST(TrackerOneCamera, StandingItWaitsForParallax) {
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  Odometry odometry(rig);
  for (const Frame& frame : walk([](int) { return SE3(); }, 12)) {
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(result.status, TrackStatus::kInitialising);
    EXPECT_EQ(result.cause, LostCause::kTooLittleParallax);
  }
}

TEST(TrackerOneCamera, TurningOnTheSpotItSaysSo) {
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  Odometry odometry(rig);
  int said = 0;
  const auto turning = [](int i) { return SE3(SO3::exp(Vector3(0.003 * i, 0.017 * i, 0)), Vector3::Zero()); };
  for (const Frame& frame : walk(turning, 24)) {
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(result.status, TrackStatus::kInitialising) << frame.index;
    said += result.cause == LostCause::kRotatingOnly;
  }
  EXPECT_GT(said, 12);
}

/// It said that there was too little parallax.
TEST(TrackerOneCamera, WhereNoFrameSeesWhatTheOneBeforeSawItSaysSo) {
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  Odometry odometry(rig);
  const auto leaping = [](int i) { return SE3(SO3::exp(Vector3(0, 1.3 * i, 0)), Vector3(0.3 * i, 0, 0)); };
  for (const Frame& frame : walk(leaping, 12)) {
    const TrackResult result = odometry.step(frame);
    EXPECT_EQ(result.status, TrackStatus::kInitialising) << frame.index;
    EXPECT_EQ(result.cause, frame.index == 0 ? LostCause::kTooLittleParallax : LostCause::kStepsTooWide)
        << frame.index;
  }
}

/// As while the mapper is behind. From the third frame on there is nothing to write a keyframe into, for so
/// long that the corners have moved further than they are looked for from one frame to the next.
TEST(TrackerOneCamera, CornersAreFollowedWhileNoKeyframeCanBeMade) {
  const auto faster = [](int i) { return corner_walk(2 * i); };
  const std::vector<Frame> frames = walk(faster, 20);
  PlainMap map;
  const GraphSnapshot empty = map.publish();
  KeyframeProposal proposal;
  Tracker tracker(test_rig(SensorKind::kMono, 320, 240), {});
  tracker.prepare(proposal);
  int started = -1;
  for (const Frame& frame : frames) {
    const bool withheld = frame.index >= 2 && frame.index < 14;
    const TrackResult result = tracker.step(frame, empty, withheld ? nullptr : &proposal);
    if (result.status == TrackStatus::kTracking) {
      started = static_cast<int>(frame.index);
      break;
    }
    EXPECT_EQ(result.cause == LostCause::kNoKeyframeBuffer, withheld) << frame.index;
  }
  EXPECT_EQ(started, 14);
}

/// Lost in another room, it stands, is covered, and has been moved on when it sees again.
TEST(TrackerOneCamera, APartDoesNotBeginWithWhatWasSeenBeforeACover) {
  Odometry odometry(SensorKind::kMono);
  for (const Frame& frame : before_the_corner()) (void)odometry.step(frame);
  const std::vector<Frame> room = walk(corner_walk, 30, 22);
  std::int64_t index = kFrames;
  const auto show = [&](Frame frame) {
    frame.index = index++;
    frame.t_ns = frame.index * 33'000'000;
    return odometry.step(frame);
  };
  for (int n = 0; n < 60; ++n) ASSERT_NE(show(room[0]).status, TrackStatus::kTracking);
  for (int n = 0; n < 40; ++n) (void)show(covered(room[0]));
  const std::int64_t sees_again = index;
  for (int n = 0; n < 30; ++n) ASSERT_NE(show(room[4]).status, TrackStatus::kTracking);
  TrackResult result;
  for (std::size_t i = 4; i < room.size() && result.status != TrackStatus::kTracking; ++i)
    result = show(room[i]);
  ASSERT_EQ(result.status, TrackStatus::kTracking) << describe(result.cause);
  EXPECT_GE(odometry.proposal().frame_index, sees_again);
}

}  // namespace
}  // namespace twofold
