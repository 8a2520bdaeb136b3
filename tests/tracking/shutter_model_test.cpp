// What rows that are read one after the other mean for a frame's pose.
#include "tracking/motion/shutter_model.hpp"

#include <gtest/gtest.h>

#include "fixtures/plain_map.hpp"
#include "fixtures/rendered_scene.hpp"
#include "tracking/effort_bounds.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr std::int64_t kInterval = 50'000'000;  // [ns]
constexpr KeyframeId kReference{0};

/// Ahead and to the side, turning [m/s, rad/s].
const Vector6 kVelocity = (Vector6() << 0.2, 0, -1, 0, 0.5, 0).finished();

class ShutterModelTest : public ::testing::Test {
 protected:
  static Rig rig(std::optional<double> readout) {
    Rig result = test_rig(SensorKind::kStereo, 320, 240);
    result.readout = readout;
    return result;
  }
  static SE3 T_c_ref(double intervals) { return SE3::exp(1e-9 * kInterval * intervals * kVelocity); }

  /// The third frame, which is `further` intervals away from the second.
  FrameStep third_frame(double further, int lost_frames = 0) {
    motion_.advance({kReference, T_c_ref(0)}, 0, false);
    motion_.advance({kReference, T_c_ref(1)}, kInterval, false);
    frame_.t_ns = 2 * kInterval;
    FrameStep step(frame_, snapshot_, nullptr, bounds_of(EffortLevel::kEverything, options_), lost_frames);
    step.result.reference = kReference;
    step.result.T_c_ref = T_c_ref(1 + further);
    return step;
  }
  double added(std::optional<double> readout, double further) {
    const FrameStep step = third_frame(further);
    const ShutterModel model(rig(readout), motion_, 100);
    return model.covariance(Matrix6::Identity(), Matrix6::Identity(), step).trace();
  }

  TrackerOptions options_;
  MotionModel motion_{options_.motion_model};
  PlainMap map_;
  GraphSnapshot snapshot_ = map_.publish();
  Frame frame_;
};

TEST_F(ShutterModelTest, RowsSeeWhatTheMotionSinceTheLastFrameTakesThemTo) {
  const FrameStep step = third_frame(1);
  const Rig known = rig(0.02);
  const RollingShutter shutter = ShutterModel(known, motion_, 100).at(step.result.T_c_ref, step);
  ASSERT_FALSE(shutter.at_rest());
  const SE3 expected = RollingShutter(known, kVelocity).T_row_c(0);
  EXPECT_LT((shutter.T_row_c(0) * expected.inverse()).log().norm(), 1e-9);
  EXPECT_GT(expected.log().norm(), 1e-3);
}

TEST_F(ShutterModelTest, IsAtRestAfterALossAndWhereNoReadoutIsKnown) {
  const FrameStep after_loss = third_frame(1, 1);
  EXPECT_TRUE(ShutterModel(rig(0.02), motion_, 100).at(after_loss.result.T_c_ref, after_loss).at_rest());
  const FrameStep step = third_frame(1);
  EXPECT_TRUE(ShutterModel(rig(std::nullopt), motion_, 100).at(step.result.T_c_ref, step).at_rest());
}

TEST_F(ShutterModelTest, AKnownReadoutErrsWhereTheMotionChanges) {
  EXPECT_LT(added(0.02, 1), 1e-12);
  const double half = 0.5 * 0.02 * kVelocity.norm();  // of the change, which is a whole velocity here
  EXPECT_NEAR(added(0.02, 2), 2 * half * half, 1e-9);
  EXPECT_EQ(added(0, 2), 0) << "a global shutter";
}

TEST_F(ShutterModelTest, AnUnknownReadoutErrsAsMuchAsTheCameraMoves) {
  const double once = added(std::nullopt, 1), twice = added(std::nullopt, 2);
  EXPECT_NEAR(once, 2 * std::pow(0.015 * kVelocity.norm(), 2), 1e-9);
  EXPECT_NEAR(twice, 4 * once, 1e-9);
}

TEST_F(ShutterModelTest, SaysNothingOfAPoseRelativeToAnotherKeyframe) {
  FrameStep step = third_frame(2);
  step.result.reference = KeyframeId{1};
  const ShutterModel model(rig(0.02), motion_, 100);
  EXPECT_TRUE(model.covariance(Matrix6::Identity(), Matrix6::Identity(), step).isZero(0));
}

}  // namespace
}  // namespace twofold
