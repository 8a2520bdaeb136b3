#include "loopclosure/loop_probation.hpp"

#include <gtest/gtest.h>

#include "graph/graph_writer.hpp"

namespace twofold {
namespace {

/// Keyframes 0 to 19 along a line, one a metre; from 10 on they are where 0 to 9 are, but the map, which has
/// drifted, does not know.
class LoopProbationTest : public ::testing::Test {
 protected:
  LoopProbationTest() {
    for (std::uint32_t k = 0; k < 20; ++k) add(k, drift_ * truth(k), KeyframeId{0});
    graph_ = writer_.publish();
  }

  void add(std::uint32_t k, const SE3& T_k_w, KeyframeId part) {
    Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    keyframe.part = part;
    keyframe.T_k_w = k < 10 ? truth(k) : T_k_w;
    keyframe.median_depth = 5;
    writer_.add_keyframe(keyframe);
    writer_.set_reference(keyframe.id);
  }
  static SE3 truth(std::uint32_t k) { return {SO3(), Vector3(-1.0 * (k % 10), 0, 0)}; }
  /// What the images say, wrong by `error`.
  static LoopConstraint loop(std::uint32_t from, std::uint32_t to, const SE3& error = SE3()) {
    return {1, KeyframeId{from}, KeyframeId{to}, error * truth(to) * truth(from).inverse(), 100};
  }

  const SE3 drift_{SO3::exp({0, 0.2, 0}), Vector3(2, 0, 1)};
  const SE3 wrong_{SO3(), Vector3(1, 0, 0)};  // beyond 0.15 of the depth
  GraphWriter writer_;
  GraphSnapshot graph_;
  LoopProbation probation_{SensorKind::kStereo, {}};
};

TEST_F(LoopProbationTest, OneAloneWaitsTwoThatAgreeJoin) {
  EXPECT_FALSE(probation_.confirms(loop(1, 11), graph_));
  EXPECT_TRUE(probation_.confirms(loop(3, 12), graph_));
  EXPECT_TRUE(probation_.confirms(loop(3, 13), graph_)) << "and so does every one that agrees from then on";
}

TEST_F(LoopProbationTest, AWrongOneFindsNoWitness) {
  EXPECT_FALSE(probation_.confirms(loop(1, 11, wrong_), graph_));
  EXPECT_FALSE(probation_.confirms(loop(2, 12), graph_)) << "the right one's first witness is itself";
  EXPECT_FALSE(probation_.confirms(loop(3, 13, wrong_.inverse()), graph_));
  EXPECT_TRUE(probation_.confirms(loop(4, 14), graph_)) << "whom the wrong ones do not hold up";
}

TEST_F(LoopProbationTest, ARoughOneIsNoWitness) {
  probation_.hold(loop(1, 11));
  EXPECT_FALSE(probation_.confirms(loop(3, 12), graph_));
  EXPECT_TRUE(probation_.confirms(loop(3, 13), graph_));
}

TEST_F(LoopProbationTest, AWrongDirectionIsNoAgreement) {
  EXPECT_FALSE(probation_.confirms(loop(1, 11), graph_));
  EXPECT_FALSE(probation_.confirms(loop(2, 12, SE3(SO3::exp({0, 0.15, 0}), Vector3::Zero())), graph_));
}

TEST_F(LoopProbationTest, AKeyframeIsNoWitnessOfItself) {
  EXPECT_FALSE(probation_.confirms(loop(1, 11), graph_));
  EXPECT_FALSE(probation_.confirms(loop(2, 11), graph_));
}

TEST_F(LoopProbationTest, TheMapItselfIsAWitness) {
  for (std::uint32_t k = 10; k < 20; ++k) writer_.set_pose(KeyframeId{k}, truth(k));
  graph_ = writer_.publish();
  EXPECT_TRUE(probation_.confirms(loop(1, 11), graph_));
  EXPECT_FALSE(probation_.confirms(loop(2, 12, wrong_), graph_));
}

TEST_F(LoopProbationTest, PatienceEnds) {
  ProbationOptions options;
  EXPECT_FALSE(probation_.confirms(loop(1, 11), graph_));
  EXPECT_TRUE(probation_.confirms(loop(1, 13), graph_)) << "they agree, if the first one is still held";
  options.patience = 1;
  LoopProbation probation(SensorKind::kStereo, options);
  EXPECT_FALSE(probation.confirms(loop(1, 11), graph_));
  EXPECT_FALSE(probation.confirms(loop(1, 13), graph_));
  EXPECT_TRUE(probation.confirms(loop(1, 14), graph_));
}

/// Two that agree, of which the way explains the second only: the first shows that places look alike here.
TEST_F(LoopProbationTest, WhatDriftDoesNotExplainIsNoWitness) {
  const LoopConstraint first = loop(1, 11, SE3(SO3(), Vector3(-0.4, 0, 0))), second = loop(3, 12);
  const DriftModel drift(SensorKind::kStereo, {});
  const auto chi2 = [&](const LoopConstraint& l) { return drift.chi2(graph_, l.from, l.to, l.S_to_from()); };
  ASSERT_GT(chi2(first), 1.1 * chi2(second));
  ProbationOptions options;
  options.drift.max_chi2 = 1.05 * chi2(first);
  LoopProbation credulous(SensorKind::kStereo, options);
  EXPECT_FALSE(credulous.confirms(first, graph_));
  EXPECT_TRUE(credulous.confirms(second, graph_));
  options.drift.max_chi2 = 0.95 * chi2(first);
  LoopProbation probation(SensorKind::kStereo, options);
  EXPECT_FALSE(probation.confirms(first, graph_));
  EXPECT_FALSE(probation.confirms(second, graph_));
}

/// Poses of different parts say nothing about each other: the map is no witness, and two loops agree along
/// each part's own poses.
TEST_F(LoopProbationTest, PartsAreJoinedByTwo) {
  for (std::uint32_t k = 20; k < 24; ++k) add(k, truth(k), KeyframeId{20});
  graph_ = writer_.publish();
  EXPECT_FALSE(probation_.confirms(loop(1, 21), graph_));
  EXPECT_FALSE(probation_.confirms(loop(2, 22, wrong_), graph_));
  EXPECT_TRUE(probation_.confirms(loop(2, 23), graph_));
}

/// A street of houses that are all alike: two loops agree, and say that 60 m of driving led nowhere.
TEST_F(LoopProbationTest, APlaceThatLooksAlikeFarAlongTheWayIsNotBelieved) {
  for (const SensorKind sensor : {SensorKind::kStereo, SensorKind::kMono}) {
    GraphWriter writer;
    const auto along = [](std::uint32_t k) { return SE3(SO3(), Vector3(0, 0, -1.0 * k)); };
    for (std::uint32_t k = 0; k < 80; ++k) {
      Keyframe keyframe;
      keyframe.id = KeyframeId{k};
      keyframe.part = KeyframeId{0};
      keyframe.T_k_w = along(k);
      keyframe.median_depth = 5;
      writer.add_keyframe(keyframe);
      writer.set_reference(keyframe.id);
    }
    const GraphSnapshot graph = writer.publish();
    const auto alike = [&](std::uint32_t from, std::uint32_t to) {  // houses repeat after 60
      return LoopConstraint{1, KeyframeId{from}, KeyframeId{to}, along(to - 60) * along(from).inverse(), 100};
    };
    LoopProbation probation(sensor, {});
    for (std::uint32_t k = 0; k < 8; ++k) EXPECT_FALSE(probation.confirms(alike(k, k + 60), graph)) << k;
    ProbationOptions without_bound;
    without_bound.drift.max_chi2 = 1e9;
    LoopProbation credulous(sensor, without_bound);
    EXPECT_FALSE(credulous.confirms(alike(0, 60), graph));
    EXPECT_TRUE(credulous.confirms(alike(1, 61), graph)) << "nothing but the way speaks against it";
  }
}

/// One camera's unit may have drifted, but not by more than the way explains.
TEST_F(LoopProbationTest, OneCameraMayHaveDriftedByAsMuchAsItWent) {
  const auto scaled = [](std::uint32_t from, std::uint32_t to, double scale) {
    LoopConstraint constraint = loop(from, to);
    constraint.scale = scale;
    constraint.T_to_from.translation() *= scale;
    return constraint;
  };
  for (const double scale : {1.04, 1.5}) {
    LoopProbation probation(SensorKind::kMono, {});
    EXPECT_FALSE(probation.confirms(scaled(1, 11, scale), graph_));
    EXPECT_EQ(probation.confirms(scaled(3, 12, scale), graph_), scale < 1.1) << scale;
  }
  LoopProbation probation(SensorKind::kMono, {});
  EXPECT_FALSE(probation.confirms(scaled(1, 11, 0.98), graph_));
  EXPECT_FALSE(probation.confirms(scaled(3, 12, 1.04), graph_)) << "of different scale, they do not agree";
  EXPECT_TRUE(probation.confirms(scaled(3, 13, 1.04), graph_)) << "drift explains either";
}

/// A street of houses that are all alike, driven round a block: what the images say is right for its copies,
/// too. A second visit to the same place, and one that the map says the same of, are no contradiction.
TEST_F(LoopProbationTest, AViewThatFitsTwoPlacesIsNotBelieved) {
  for (std::uint32_t k = 10; k < 20; ++k) writer_.set_pose(KeyframeId{k}, drift_ * truth(k));
  graph_ = writer_.publish();
  const SE3 a_house(SO3(), Vector3(6, 0, 0));  // looks like the place that is 6 m on
  const LoopConstraint other{1, KeyframeId{8}, KeyframeId{12}, loop(8, 12).T_to_from * a_house, 100};
  LoopProbation rough(SensorKind::kStereo, {});
  EXPECT_FALSE(rough.confirms(loop(2, 11), graph_));
  rough.hold(other);
  EXPECT_FALSE(rough.confirms(loop(3, 13), graph_)) << "a rough one shows it, too";
  EXPECT_FALSE(probation_.confirms(loop(2, 11), graph_));
  EXPECT_FALSE(probation_.confirms(other, graph_));
  EXPECT_FALSE(probation_.confirms(loop(3, 13), graph_)) << "though 11 agrees";
  for (std::uint32_t k = 10; k < 20; ++k) writer_.set_pose(KeyframeId{k}, truth(k));
  graph_ = writer_.publish();
  EXPECT_TRUE(probation_.confirms(loop(3, 14), graph_)) << "the map says the same";
}

}  // namespace
}  // namespace twofold
