#include "estimation/pose_consensus.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "tests/allocation_counter.hpp"

namespace twofold {
namespace {

Rig stereo_rig() {
  Rig rig;
  rig.camera = {.fx = 450, .fy = 455, .cx = 320, .cy = 240, .width = 640, .height = 480};
  rig.baseline = 0.12;
  return rig;
}

class PoseConsensusTest : public ::testing::Test {
 protected:
  const Rig rig_ = stereo_rig();
  const SE3 T_c_ref_ = SE3(SO3::exp(Vector3(0.1, -0.3, 0.05)), Vector3(0.3, -0.1, 0.2));
  std::mt19937 random_{3};

  /// A point somewhere in the camera's view, as both frames see it.
  MotionObservation right_match() {
    std::uniform_real_distribution<double> u(20, 620), v(20, 460), depth(1, 5);
    const Vector3 x_c = rig_.camera.unproject(Vector2(u(random_), v(random_))) * depth(random_);
    const Eigen::Vector3f z = rig_.project(x_c).cast<float>();
    return observe_point(rig_, T_c_ref_.inverse() * x_c, z, 0);
  }
  std::vector<MotionObservation> matches(int right, int wrong) {
    std::vector<MotionObservation> all;
    for (int i = 0; i < right; ++i) all.push_back(right_match());
    for (int i = 0; i < wrong; ++i) {
      all.push_back(right_match());
      all.back().x_ref = right_match().x_ref;
    }
    std::shuffle(all.begin(), all.end(), random_);
    return all;
  }
  [[nodiscard]] double error(const SE3& found) const { return (found * T_c_ref_.inverse()).log().norm(); }
};

TEST_F(PoseConsensusTest, FindsThePoseThatAFifthOfTheMatchesAgreeOn) {
  PoseConsensus consensus(rig_, 200, {.max_samples = 2000});
  const auto all = matches(40, 160);
  const auto found = consensus.find(all, 40);
  ASSERT_TRUE(found);
  EXPECT_LT(error(*found), 1e-3);
}

// Depths err by a third of a metre where they are far. As often as without a look at the sides of what is
// drawn.
TEST_F(PoseConsensusTest, FindsThePoseAmongDepthsThatErr) {
  std::normal_distribution<double> noise(0, 0.5);
  int found = 0;
  for (int trial = 0; trial < 50; ++trial) {
    auto all = matches(40, 60);
    for (MotionObservation& match : all) {
      Vector3 z_ref = rig_.project(match.x_ref);
      for (int k = 0; k < 3; ++k) {
        z_ref[k] += noise(random_);
        match.pixel[k] += static_cast<float>(noise(random_));
      }
      match.x_ref = rig_.unproject(z_ref);
    }
    const auto pose = PoseConsensus(rig_, 200, {.inlier_sigmas = 8, .max_samples = 2000}).find(all, 20);
    found += pose && error(*pose) < 0.1;
  }
  EXPECT_GE(found, 37);
}

// Of numbers of matches that fill the last batch, and that do not: nobody agrees but the matches that do.
TEST_F(PoseConsensusTest, CountsThoseThatAgreeAndNoOthers) {
  for (const int wrong : {0, 1, 2, 3, 4, 5, 40, 77}) {
    PoseConsensus consensus(rig_, 200, {.max_samples = 2000});
    const auto all = matches(20, wrong);
    const auto found = consensus.find(all, 20);
    ASSERT_TRUE(found) << wrong;
    int agreeing = 0;
    for (const MotionObservation& match : all) agreeing += consensus.explains(*found, match);
    EXPECT_TRUE(consensus.find(all, agreeing)) << wrong;
    EXPECT_FALSE(consensus.find(all, agreeing + 1)) << wrong;
  }
}

// Their projection is where they were seen: only that they are behind the camera speaks against them.
TEST_F(PoseConsensusTest, PointsBehindTheCameraDoNotAgree) {
  PoseConsensus consensus(rig_, 200, {});
  auto all = matches(9, 6);
  for (MotionObservation& match : all) {
    if (consensus.explains(T_c_ref_, match)) continue;
    MotionObservation behind = right_match();
    behind.x_ref = T_c_ref_.inverse() * (-(T_c_ref_ * behind.x_ref));
    match = behind;
  }
  EXPECT_TRUE(consensus.find(all, 9));
  EXPECT_FALSE(consensus.find(all, 10));
}

TEST_F(PoseConsensusTest, GoesByMatchesWithDepthInBothFramesAndByAsManyAsThereIsRoomFor) {
  PoseConsensus consensus(rig_, 30, {});
  auto all = matches(33, 0);
  EXPECT_TRUE(consensus.find(all, 30));
  EXPECT_FALSE(consensus.find(all, 31));
  all.resize(30);
  for (std::size_t i = 0; i < 5; ++i) all[i].information.z() = 0;
  for (std::size_t i = 5; i < 10; ++i) all[i].pixel.z() = all[i].pixel.x() - 0.4F;
  EXPECT_TRUE(consensus.find(all, 20));
  EXPECT_FALSE(consensus.find(all, 21));
}

TEST_F(PoseConsensusTest, RepeatsItselfAndAllocatesNothing) {
  PoseConsensus consensus(rig_, 200, {.max_samples = 500});
  const auto all = matches(30, 170);
  const auto first = consensus.find(all, 8);
  const std::uint64_t before = testing::allocations();
  const auto second = consensus.find(all, 8);
  if (testing::allocations_are_counted()) {
    EXPECT_EQ(testing::allocations(), before);
  }
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->matrix(), second->matrix());
}

}  // namespace
}  // namespace twofold
