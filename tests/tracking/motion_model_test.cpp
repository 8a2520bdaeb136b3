// Where a camera is expected that goes on as it moved.
#include "tracking/motion/motion_model.hpp"

#include <gtest/gtest.h>

namespace twofold {
namespace {

constexpr std::int64_t kInterval = 100'000'000;  // [ns]
constexpr KeyframeId kReference{3};

/// 10 m/s ahead and half a turn in 10 s.
const Vector6 kVelocity = (Vector6() << 0, 0, -10, 0, 0.314, 0).finished();

class MotionModelTest : public ::testing::Test {
 protected:
  /// Frames up to number `last` have poses.
  void move_to(int last) {
    for (int i = 0; i <= last; ++i) model_.advance({kReference, T_c_ref(i)}, i * kInterval, false);
  }
  /// After so many intervals.
  static SE3 T_c_ref(double i) { return SE3::exp(1e-9 * kInterval * i * kVelocity); }
  static double between(const SE3& T_a, const SE3& T_b) { return (T_a * T_b.inverse()).log().norm(); }

  MotionModelOptions options_;
  MotionModel model_{options_};
};

TEST_F(MotionModelTest, ExpectsConstantVelocityAlsoWhereFramesAreMissing) {
  move_to(2);
  EXPECT_LT(between(model_.predicted_pose(3 * kInterval, false), T_c_ref(3)), 1e-9);
  EXPECT_LT(between(model_.predicted_pose(5 * kInterval, false), T_c_ref(5)), 1e-9);
}

TEST_F(MotionModelTest, StampsThatJitterSayNothing) {
  move_to(2);
  const auto late = static_cast<std::int64_t>(3.2 * kInterval);
  EXPECT_LT(between(model_.predicted_pose(late, false), T_c_ref(3)), 1e-9);
}

TEST_F(MotionModelTest, ExpectsRestAfterALossAndAfterTooLong) {
  move_to(2);
  EXPECT_LT(between(model_.predicted_pose(3 * kInterval, true), T_c_ref(2)), 1e-12);
  const auto long_after = 2 * kInterval + static_cast<std::int64_t>(1e9 * options_.coast_for) + kInterval;
  EXPECT_LT(between(model_.predicted_pose(long_after, false), T_c_ref(2)), 1e-12);
  EXPECT_FALSE(model_.coasted(long_after));
  EXPECT_TRUE(model_.coasted(long_after - 2 * kInterval));
}

TEST_F(MotionModelTest, KnowsNoMotionAcrossALossOrToAnotherReference) {
  move_to(2);
  EXPECT_LT((*model_.velocity() - kVelocity).norm(), 1e-9);
  model_.advance({kReference, T_c_ref(9)}, 9 * kInterval, true);
  EXPECT_FALSE(model_.velocity());
  EXPECT_FALSE(model_.since_previous());
  EXPECT_FALSE(model_.coasted(10 * kInterval));
  move_to(2);
  model_.advance({KeyframeId{4}, T_c_ref(3)}, 3 * kInterval, false);
  EXPECT_FALSE(model_.velocity());
  EXPECT_FALSE(model_.since_previous());
}

TEST_F(MotionModelTest, ReferringToAnotherKeyframeChangesNoMotion) {
  move_to(2);
  const SE3 T_old_new = SE3::exp((Vector6() << 1, 2, 3, 0.1, 0.2, 0.3).finished());
  model_.refer_to(KeyframeId{7}, T_old_new);
  EXPECT_EQ(model_.reference(), KeyframeId{7});
  EXPECT_LT(between(model_.predicted_pose(3 * kInterval, false), T_c_ref(3) * T_old_new), 1e-9);
  model_.advance({KeyframeId{7}, T_c_ref(3) * T_old_new}, 3 * kInterval, false);
  EXPECT_LT((*model_.velocity() - kVelocity).norm(), 1e-9);
}

TEST_F(MotionModelTest, VelocityInAFrameIsTheMotionSinceTheLastOne) {
  move_to(2);
  EXPECT_LT((*model_.velocity_at(T_c_ref(4), 4 * kInterval, false) - kVelocity).norm(), 1e-9);
  EXPECT_FALSE(model_.velocity_at(T_c_ref(4), 4 * kInterval, true));
  EXPECT_FALSE(model_.velocity_at(T_c_ref(4), 2 * kInterval, false)) << "no time has passed";
}

TEST_F(MotionModelTest, ReachesWhereAccelerationMayHaveTakenIt) {
  move_to(2);
  const std::int64_t then = 7 * kInterval;  // half a second later
  const double reach = options_.reach_slack + 0.5 * options_.max_acceleration * 0.25;
  const auto beside = [&](double metres) {
    return SE3(SO3(), Vector3(metres, 0, 0)) * T_c_ref(7) * T_c_ref(2).inverse();
  };
  EXPECT_TRUE(model_.reaches(beside(0.99 * reach), then, false));
  EXPECT_FALSE(model_.reaches(beside(1.01 * reach), then, false));
}

/// 10 s at 10 m/s: only who may have gone on all that time is so far away.
TEST_F(MotionModelTest, GoesOnNoLongerThanItCoasts) {
  move_to(2);
  const std::int64_t then = 102 * kInterval;
  const SE3 T_c_last = T_c_ref(102) * T_c_ref(2).inverse();
  EXPECT_TRUE(model_.reaches(T_c_last, then, true));
  EXPECT_FALSE(model_.reaches(T_c_last, then, false));
  const double coasting = options_.coast_for / (1e-9 * kInterval);
  EXPECT_TRUE(model_.reaches(T_c_ref(2 + coasting) * T_c_ref(2).inverse(), then, false));
}

TEST_F(MotionModelTest, WhereverItIsItMayBeBeforeItMoved) {
  model_.advance({kReference, SE3()}, 0, false);
  EXPECT_TRUE(model_.reaches(T_c_ref(1000), kInterval, false));
}

}  // namespace
}  // namespace twofold
