#include "tracking/keyframes/keyframe_decision.hpp"

#include "tracking/effort_bounds.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

/// A frame that sees 90 of 100 points, from where the last keyframe was made.
class KeyframeDecisionTest : public ::testing::Test {
 protected:
  KeyframeDecisionTest() {
    result_.reference_in_view = 1;
    result_.searched = 100;
    result_.matches = result_.inliers = 90;
  }

  void move(double depths) { result_.T_c_ref = SE3(SO3(), {0, depths * last_.median_depth, 0}); }
  [[nodiscard]] bool due(EffortLevel effort = EffortLevel::kEverything) const {
    return keyframe_due(result_, last_, seen_, backlog_, options_.keyframes, bounds_of(effort, options_));
  }
  [[nodiscard]] bool due_by_motion() const {
    return keyframe_due_by_motion(result_.T_c_ref, last_, backlog_, options_.keyframes);
  }

  const TrackerOptions options_;
  TrackResult result_;
  KeyframeView last_{.median_depth = 2, .occupied_regions = 20};
  KeyframeBacklog backlog_{.room = true, .pending = 0, .map_is_young = false};
  TrackedView seen_{.occupied_regions = 20};
};

TEST_F(KeyframeDecisionTest, NoneWhereTheCameraStands) {
  EXPECT_FALSE(due());
  EXPECT_FALSE(due_by_motion());
}

TEST_F(KeyframeDecisionTest, WhenTheCameraHasMovedOn) {
  move(0.95 * options_.keyframes.parallax);
  EXPECT_FALSE(due());
  EXPECT_FALSE(due_by_motion());
  move(1.05 * options_.keyframes.parallax);
  EXPECT_TRUE(due());
  EXPECT_TRUE(due_by_motion());
}

TEST_F(KeyframeDecisionTest, WhenLittleIsLeftOfWhatTheReferenceSaw) {
  result_.matches = 66;
  EXPECT_FALSE(due());
  result_.matches = 64;
  EXPECT_TRUE(due()) << "the others are hidden, or look otherwise";
  result_.matches = 90;
  result_.reference_in_view = 0.7;
  EXPECT_TRUE(due()) << "the others are out of view";
}

TEST_F(KeyframeDecisionTest, WherePointsAreHardToFindOneCameraMakesNoMore) {
  last_.most_tracked = 0.6;
  result_.matches = 58;
  result_.inliers = 79;
  EXPECT_TRUE(due()) << "too few to do without new ones";
  result_.inliers = 80;
  EXPECT_FALSE(due()) << "a keyframe would not make them easier to find";
  move(0.25 * options_.keyframes.parallax);
  EXPECT_TRUE(due()) << "its unit of length is held by keyframes";
  seen_.revisits = true;
  EXPECT_FALSE(due()) << "by older ones here";
  move(0.55 * options_.keyframes.parallax);
  EXPECT_TRUE(due()) << "depths are seen anew";
  move(0);
  result_.matches = 56;
  EXPECT_TRUE(due()) << "what could be found is going";
  last_.most_tracked = 0.9;
  result_.matches = 66;
  EXPECT_FALSE(due()) << "much is gone, but enough is left";
  last_.most_tracked = 0.34;
  result_.matches = 34;
  EXPECT_TRUE(due()) << "too little to wait";
}

TEST_F(KeyframeDecisionTest, EarlierWhereFewPointsAreLeft) {
  result_.reference_in_view = 0.85;  // share: 0.765
  result_.inliers = options_.keyframes.few_points;
  EXPECT_FALSE(due());
  --result_.inliers;
  EXPECT_TRUE(due()) << "a turn goes on, and takes the rest of them out of view";
  seen_.young_mistrusted = true;
  EXPECT_FALSE(due()) << "what passes by would get new points, too";
  seen_.young_mistrusted = false;
  last_.most_tracked = 0.8;
  EXPECT_FALSE(due()) << "one camera's new points have no depth yet";
  last_.most_tracked.reset();
  result_.reference_in_view = 0.9;  // 0.81
  EXPECT_FALSE(due()) << "the camera hardly moved";
}

TEST_F(KeyframeDecisionTest, WhenHalfOfTheImageHasEmptied) {
  seen_.occupied_regions = 10;
  EXPECT_FALSE(due());
  seen_.occupied_regions = 9;
  EXPECT_TRUE(due());
}

TEST_F(KeyframeDecisionTest, TheSecondOneComesEarly) {
  move(0.25 * options_.keyframes.parallax);
  EXPECT_FALSE(due());
  backlog_.map_is_young = true;
  EXPECT_TRUE(due());
  EXPECT_TRUE(due(EffortLevel::kFewerIterations)) << "without it there is no map";
  move(0.15 * options_.keyframes.parallax);
  EXPECT_FALSE(due());
}

TEST_F(KeyframeDecisionTest, AMapperThatIsBehindGetsUrgentOnesOnly) {
  backlog_.pending = options_.keyframes.max_pending;
  move(1);
  EXPECT_FALSE(due());
  EXPECT_FALSE(due_by_motion());
  result_.matches = 36;
  EXPECT_FALSE(due());
  result_.matches = 34;
  EXPECT_TRUE(due());
  backlog_.room = false;
  EXPECT_FALSE(due());
  backlog_ = {.room = false, .pending = 0};
  EXPECT_FALSE(due_by_motion());
}

TEST_F(KeyframeDecisionTest, ATrackerThatIsBehindMakesUrgentOnesOnly) {
  move(1);
  result_.matches = 36;
  EXPECT_FALSE(due(EffortLevel::kFewerIterations));
  result_.matches = 34;
  EXPECT_TRUE(due(EffortLevel::kFewerIterations));
}

TEST_F(KeyframeDecisionTest, ByDepthWhenTheCameraHasTurned) {
  result_.T_c_ref = SE3(SO3::exp({0, 0.19, 0}), Vector3::Zero());
  EXPECT_FALSE(due_by_motion());
  result_.T_c_ref = SE3(SO3::exp({0, 0.21, 0}), Vector3::Zero());
  EXPECT_TRUE(due_by_motion());
}

TEST_F(KeyframeDecisionTest, AsTheOptionsSay) {
  KeyframeDecisionOptions patient;
  patient.turn = 0.3;
  patient.young_map_share = 0.5;
  result_.T_c_ref = SE3(SO3::exp({0, 0.25, 0}), Vector3::Zero());
  EXPECT_FALSE(keyframe_due_by_motion(result_.T_c_ref, last_, backlog_, patient));
  backlog_.map_is_young = true;
  const EffortBounds bounds = bounds_of(EffortLevel::kEverything, options_);
  move(0.45 * patient.parallax);
  EXPECT_FALSE(keyframe_due(result_, last_, seen_, backlog_, patient, bounds));
  move(0.55 * patient.parallax);
  EXPECT_TRUE(keyframe_due(result_, last_, seen_, backlog_, patient, bounds));
}

}  // namespace
}  // namespace twofold
