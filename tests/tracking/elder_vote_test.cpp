#include "tracking/common/elder_vote.hpp"

#include <gtest/gtest.h>

#include <random>

#include "fixtures/rendered_scene.hpp"

namespace twofold {
namespace {

using testing::test_rig;

/// Points before a camera that stands still; the young ones may have moved since they were found.
class ElderVoteTest : public ::testing::Test {
 protected:
  void add(int count, KeyframeId anchor, const Vector3& moved) {
    std::uniform_real_distribution<double> side(-1, 1), depth(2, 8);
    for (int n = 0; n < count; ++n) {
      const Vector3 x(side(random_), side(random_), depth(random_));
      const Eigen::Vector3f z = rig_.project(x + moved).cast<float>();
      observations_.push_back(observe_point(rig_, x, z, 0));
      anchors_.push_back(anchor);
    }
  }
  std::optional<MotionOnlyResult> ask() {
    const MotionOnlyResult by_all = optimise_motion(rig_, observations_, SE3(), {});
    const ElderVote::Verdict verdict = vote_.ask(observations_, anchors_, by_all, {});
    vote_.remember(verdict);
    return verdict.by_elders;
  }

  const Rig rig_ = test_rig(SensorKind::kStereo, 320, 240);
  ElderVote vote_{rig_, 300, {}};
  std::mt19937 random_{3};
  std::vector<MotionObservation> observations_;
  std::vector<KeyframeId> anchors_;
};

TEST_F(ElderVoteTest, TheOldestAreBelievedThoughTheYoungAreMore) {
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  const auto pose = ask();
  ASSERT_TRUE(pose);
  EXPECT_LT(pose->T_c_ref.translation().norm(), 1e-3);
  EXPECT_LE(pose->inliers, 70);
  EXPECT_TRUE(vote_.mistrusts_the_young());
}

/// The frame may be searched from another start, too: only the verdict on the pose that it is given counts.
TEST_F(ElderVoteTest, AVerdictThatIsNotRememberedChangesNothing) {
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  const MotionOnlyResult by_all = optimise_motion(rig_, observations_, SE3(), {});
  EXPECT_TRUE(vote_.ask(observations_, anchors_, by_all, {}).by_elders);
  EXPECT_FALSE(vote_.mistrusts_the_young());
}

TEST_F(ElderVoteTest, NobodyIsOverruledWhereAllAgree) {
  add(60, KeyframeId{0}, Vector3(0.1, 0, 0));
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  EXPECT_FALSE(ask());
  EXPECT_FALSE(vote_.mistrusts_the_young());
}

TEST_F(ElderVoteTest, AFewElderOnesAreNotEnough) {
  add(20, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  EXPECT_FALSE(ask());
}

TEST_F(ElderVoteTest, TheirShareAloneDoesNotMakeThemEnough) {
  add(28, KeyframeId{0}, Vector3::Zero());
  add(52, KeyframeId{7}, Vector3(0.1, 0, 0));
  EXPECT_FALSE(ask());
  ElderVoteOptions fewer;
  fewer.min_elders = 28;
  vote_ = ElderVote(rig_, 300, fewer);
  EXPECT_TRUE(ask());
}

/// A quarter of the elders were found on what hides them, near to where they would be seen.
TEST_F(ElderVoteTest, WhileTheYoungAreMistrustedElderOnesMustBeWhereTheOthersAre) {
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  ASSERT_TRUE(ask());
  for (std::size_t n = 0; n < 60; ++n) {
    const float shift = n % 4 == 0 ? 1.1F : 0.05F * (static_cast<float>(n % 3) - 1);
    observations_[n].pixel += Eigen::Vector3f(shift, 0, shift);
  }
  const auto pose = ask();
  ASSERT_TRUE(pose);
  EXPECT_LT(pose->T_c_ref.translation().norm(), 1e-3);
}

/// Some of the oldest points are on what passes as well: then they are no witnesses.
TEST_F(ElderVoteTest, EldersThatDisagreeOverruleNobody) {
  add(34, KeyframeId{0}, Vector3::Zero());
  add(26, KeyframeId{0}, Vector3(0, 0.3, 0));
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  EXPECT_FALSE(ask());
  EXPECT_FALSE(vote_.mistrusts_the_young());
}

/// The map has drifted between its old and its new keyframes: the young go with either pose.
TEST_F(ElderVoteTest, TheYoungThatGoWithTheEldersAreNotMistrusted) {
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.012, 0, 0));
  ElderVoteOptions any_dissent;
  any_dissent.min_loyal_share = 1;
  vote_ = ElderVote(rig_, 300, any_dissent);
  ASSERT_TRUE(ask()) << "the elders' pose is another";
  vote_ = ElderVote(rig_, 300, {});
  EXPECT_FALSE(ask());
}

/// A map whose unit drifts has old points where new ones contradict them, now more, now less. What passes
/// brings far more at once.
TEST_F(ElderVoteTest, WhatOldAndNewPointsUsuallyDifferByIsNoDissent) {
  const auto ask_where_the_young_moved = [&](double x) {
    random_.seed(3);  // the same points each time
    observations_.clear();
    anchors_.clear();
    add(60, KeyframeId{0}, Vector3::Zero());
    add(100, KeyframeId{7}, Vector3(x, 0, 0));
    return ask().has_value();
  };
  const auto forget = [&] { vote_ = ElderVote(rig_, 300, {}); };
  double dissent = 0.012;  // as far as the young must have moved to be overruled where nothing else is usual
  for (; !ask_where_the_young_moved(dissent); forget()) dissent *= 1.02;
  ASSERT_LT(dissent, 0.05);
  forget();
  for (int frame = 0; frame < 40; ++frame) ASSERT_FALSE(ask_where_the_young_moved(dissent / 1.1)) << frame;
  EXPECT_FALSE(ask_where_the_young_moved(dissent));
  EXPECT_FALSE(vote_.mistrusts_the_young());
  EXPECT_TRUE(ask_where_the_young_moved(0.1));
}

/// Far elders in the middle of the image hardly know how the camera is turned about its axis; where some of
/// them were found beside where they are, these decide. The nearer young know it.
TEST_F(ElderVoteTest, MistakesAmongFarEldersDoNotOverruleWhatTheMostOfThemSee) {
  constexpr int kElders = 42, kMistakes = 12;
  std::uniform_real_distribution<double> side(-0.1, 0.1), depth(10, 20);
  for (int trial = 0; trial < 200; ++trial) {
    observations_.clear();
    anchors_.clear();
    for (int n = 0; n < kElders; ++n) {
      const double z = depth(random_);
      const Vector3 x(z * side(random_), z * side(random_), z);
      Eigen::Vector3f measured = rig_.project(x).cast<float>();
      if (n < kMistakes) measured.y() += x.x() > 0 ? 1.5F : -1.5F;
      observations_.push_back(observe_point(rig_, x, measured, 0));
      anchors_.push_back(KeyframeId{0});
    }
    add(80, KeyframeId{7}, Vector3::Zero());
    EXPECT_FALSE(ask()) << trial;
  }
}

TEST_F(ElderVoteTest, TheYoungAreHeardAgainAfterAWhile) {
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{7}, Vector3(0.1, 0, 0));
  ASSERT_TRUE(ask());
  observations_.clear();
  anchors_.clear();
  add(60, KeyframeId{0}, Vector3::Zero());
  add(100, KeyframeId{8}, Vector3::Zero());
  for (int frame = 0; frame < ElderVoteOptions{}.mistrusted_frames; ++frame) EXPECT_TRUE(ask()) << frame;
  EXPECT_FALSE(ask());
}

}  // namespace
}  // namespace twofold
