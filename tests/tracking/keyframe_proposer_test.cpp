// What of a frame becomes part of the map.
#include "tracking/keyframes/keyframe_proposer.hpp"

#include <gtest/gtest.h>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_scene.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr int kPoints = 12;

class KeyframeProposerTest : public ::testing::Test {
 protected:
  KeyframeProposerTest() {
    frame_.index = 7;
    proposer_.begin({kNoKeyframe, SE3()}, {2, 20}, step_, immature_);
    for (int i = 0; i < kPoints; ++i) {
      ImmaturePoint point;
      point.anchor = proposal_.id;
      point.psi = {0.1 * i - 0.5, 0.05 * i, 0.5};
      immature_.add(point);
    }
    local_map_.update(snapshot_, proposal_.id, immature_, 20);
  }
  /// All points are found, last ones first; the first two are outliers.
  void find_all() {
    found_.clear();
    for (std::uint32_t i = kPoints; i-- > 0;) {
      const Vector3& x = local_map_.points()[i].x_ref;
      found_.matches.push_back({i, {Vector3(320 * (x.x() / x.z() + 0.5), 120, 100), 1, 0}});
      found_.observations.push_back({x, {1, 2, 3}, {1, 1, 1}});
      found_.observations.back().inlier = i >= 2;
    }
  }
  void propose_next(bool mistrusts_the_young) {
    proposer_.begin({KeyframeId{0}, SE3(SO3(), {0.1, 0, 0})}, {3, 25}, step_, immature_);
    proposer_.add_observations(found_, local_map_, mistrusts_the_young, immature_, proposal_);
  }

  const Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  const TrackerOptions options_;
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  Frame frame_;
  KeyframeProposal proposal_;
  FrameStep step_{frame_, snapshot_, &proposal_, bounds_of(EffortLevel::kEverything, options_), 0};
  ImmaturePoints immature_{100, 4};
  LocalMap local_map_{100};
  SearchOutcome found_{rig_, options_.local_map.max_searches};
  KeyframeProposer proposer_{SensorKind::kStereo, options_};
};

TEST_F(KeyframeProposerTest, NumbersKeyframesAsItProposesThem) {
  EXPECT_EQ(proposal_.id, KeyframeId{0});
  EXPECT_TRUE(proposer_.is_newest(KeyframeId{0}));
  EXPECT_EQ(proposal_.frame_index, 7);
  EXPECT_EQ(proposal_.median_depth, 2);
  EXPECT_TRUE(step_.result.proposed);
  find_all();
  propose_next(false);
  EXPECT_EQ(proposal_.id, KeyframeId{1});
  EXPECT_EQ(proposal_.reference, KeyframeId{0});
  EXPECT_EQ(proposer_.next(), KeyframeId{2});
  EXPECT_EQ(immature_.pending().size(), 2U);
}

TEST_F(KeyframeProposerTest, OneCameraComparesWithTheBestFrameFromTheLastKeyframeOn) {
  for (const SensorKind kind : {SensorKind::kMono, SensorKind::kStereo}) {
    KeyframeProposer proposer{kind, options_};
    ImmaturePoints immature{100, 4};
    proposer.begin({kNoKeyframe, SE3()}, {2, 20}, step_, immature);
    step_.result.reference = KeyframeId{0};
    const auto due = [&](int matches) {
      step_.result.reference_in_view = 1;
      step_.result.searched = 100;
      step_.result.matches = matches;
      step_.result.inliers = 100;
      return proposer.due(step_, {20}, immature);
    };
    const bool measures_depth = kind != SensorKind::kMono;
    EXPECT_EQ(due(58), measures_depth);
    EXPECT_EQ(due(62), measures_depth);
    EXPECT_EQ(due(60), measures_depth);
    EXPECT_TRUE(due(58)) << "best was 62";
    immature = ImmaturePoints(100, 4);
    proposer.begin({KeyframeId{0}, SE3()}, {2, 20}, step_, immature);
    EXPECT_EQ(due(56), measures_depth) << "the keyframe itself found 58";
    EXPECT_TRUE(due(55));
  }
}

TEST_F(KeyframeProposerTest, APlaceSeenAgainShowsPointsOfKeyframesLongAgo) {
  TrackerOptions options;
  options.keyframes.revisited_after = 2;
  KeyframeProposer proposer{SensorKind::kMono, options};
  ImmaturePoints others{100, 4};
  proposer.begin({kNoKeyframe, SE3()}, {2, 20}, step_, others);
  EXPECT_FALSE(proposer.revisits(found_, local_map_)) << "nothing is found";
  find_all();
  EXPECT_FALSE(proposer.revisits(found_, local_map_)) << "of the keyframe before";
  proposer.begin({KeyframeId{0}, SE3()}, {2, 20}, step_, others);
  EXPECT_TRUE(proposer.revisits(found_, local_map_));

  propose_next(false);
  for (std::size_t i = 4; i < kPoints; ++i) immature_.points()[i].anchor = KeyframeId{1};
  immature_.changed();
  local_map_.update(snapshot_, KeyframeId{0}, immature_, 20);
  EXPECT_FALSE(proposer.revisits(found_, local_map_)) << "two of ten are old";
  options.keyframes.revisited_share = 0.2;
  EXPECT_TRUE(proposer.revisits(found_, local_map_));
}

TEST_F(KeyframeProposerTest, PointsFoundAgainGetNumbersAndGoToTheMapOnce) {
  find_all();
  propose_next(false);
  ASSERT_EQ(proposal_.observations.size(), kPoints - 2U);
  ASSERT_EQ(proposal_.points.size(), kPoints - 2U);
  for (std::uint32_t n = 0; n < kPoints - 2U; ++n) {
    EXPECT_EQ(proposal_.observations[n].point, PointId{n}) << "in the order of their numbers";
    EXPECT_EQ(proposal_.observations[n].level, 1);
  }
  EXPECT_EQ(immature_.points()[0].id, kNoPoint) << "an outlier";
  EXPECT_EQ(immature_.points()[5].proposed_in, KeyframeId{1});
  propose_next(false);
  EXPECT_EQ(proposal_.observations.size(), kPoints - 2U);
  EXPECT_TRUE(proposal_.points.empty());
}

TEST_F(KeyframeProposerTest, RaysAreNoPointsOfTheMapButTheirPoseIsKept) {
  find_all();
  for (std::size_t i = 4; i < kPoints; ++i) immature_.points()[i].ray_sigma = 0.3;
  step_.result.by_rays = true;
  step_.result.information = 5 * Matrix6::Identity();
  propose_next(false);
  EXPECT_EQ(proposal_.observations.size(), 2U);
  EXPECT_EQ(proposal_.points.size(), 2U);
  EXPECT_EQ(proposal_.pose_information, step_.result.information);
}

TEST_F(KeyframeProposerTest, WhatWasFoundOnceOnlyIsLeftOutWhereTheYoungAreMistrusted) {
  find_all();
  immature_.points()[4].agreed = static_cast<std::uint8_t>(options_.immature.trusted_after);
  propose_next(true);
  ASSERT_EQ(proposal_.observations.size(), 1U);
  EXPECT_EQ(immature_.points()[4].id, proposal_.observations[0].point);
}

/// The first keyframe's points wait to be confirmed by a second one, sooner than any later one would come.
TEST_F(KeyframeProposerTest, TheSecondKeyframeOfAPartComesSoon) {
  step_.result.reference = KeyframeId{0};
  step_.result.reference_in_view = 1;
  step_.result.searched = step_.result.matches = 100;
  step_.result.T_c_ref = SE3(SO3(), {0.5 * options_.keyframes.parallax * 2, 0, 0});
  EXPECT_TRUE(proposer_.due(step_, {20}, immature_));
  find_all();
  propose_next(false);
  step_.result.reference = KeyframeId{1};
  EXPECT_FALSE(proposer_.due(step_, {25}, immature_));
}

TEST_F(KeyframeProposerTest, NoKeyframeWithoutABuffer) {
  FrameStep without(frame_, snapshot_, nullptr, step_.bounds, 0);
  without.result.reference = KeyframeId{0};
  EXPECT_FALSE(proposer_.due(without, {}, immature_));
  step_.result.reference = KeyframeId{0};
  EXPECT_TRUE(proposer_.due(step_, {}, immature_)) << "nothing is left of what the first one saw";
}

TEST_F(KeyframeProposerTest, CountsRegionsInWhichSomethingIsTracked) {
  EXPECT_EQ(occupied_regions(rig_.camera, found_), 0);
  find_all();
  const int all = occupied_regions(rig_.camera, found_);
  EXPECT_GT(all, 2);
  for (MotionObservation& observation : found_.observations) observation.inlier = false;
  EXPECT_EQ(occupied_regions(rig_.camera, found_), 0);
  found_.observations.front().inlier = true;
  EXPECT_EQ(occupied_regions(rig_.camera, found_), 1);
}

}  // namespace
}  // namespace twofold
