// A camera whose rows are exposed one after the other, turned quickly to and fro.
#include <gtest/gtest.h>

#include <cstdio>
#include <map>

#include "tests/tracking/tracked_sequence.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr double kReadout = 0.027;
constexpr double kInterval = 1.0 / 30;

/// Turns to 45 degrees and back, at up to 70 degrees a second; at rest in the first frame.
SE3 shaken_T_c_w(double seconds) {
  const double swing = 0.5 * (1 - std::cos(2 * M_PI * 0.5 * seconds));
  return {SO3::exp(Vector3(0.1 * swing, 0.78 * swing, -0.08 * swing)), Vector3(0.1 * swing, 0, -0.1 * swing)};
}

const std::vector<Frame>& shaken_frames() {
  static std::vector<Frame> result;
  if (!result.empty()) return result;
  const Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  RenderedScene scene(rig, {3, 2, 5}, 21);
  const SE3 T_r_c(SO3(), Vector3(-rig.baseline, 0, 0));
  for (int i = 0; i < kFrames; ++i) {
    const auto T_c_w_of = [&](int row) {
      return shaken_T_c_w(i * kInterval + ((row + 0.5) / rig.camera.height - 0.5) * kReadout);
    };
    result.push_back({i,
                      static_cast<std::int64_t>(i * kInterval * 1e9),
                      scene.render_rows(T_c_w_of, 2),
                      scene.render_rows([&](int row) { return T_r_c * T_c_w_of(row); }, 2),
                      {}});
  }
  return result;
}

ReadoutEstimate found;  // by the tracker that was asked for its error

/// Root mean square of the camera's distance from where it is [m].
double error_with(std::optional<double> readout) {
  Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  rig.readout = readout;
  Odometry odometry(rig);
  double squares = 0;
  found = {};
  for (int i = 0; i < kFrames; ++i) {
    const TrackResult result = odometry.step(shaken_frames()[static_cast<std::size_t>(i)]);
    EXPECT_EQ(result.status, TrackStatus::kTracking) << i;
    const SE3 truth = shaken_T_c_w(i * kInterval) * shaken_T_c_w(0).inverse();
    squares += (odometry.T_c_w(result).inverse() * truth).translation().squaredNorm();
  }
  if (odometry.tracker().readout()) found = *odometry.tracker().readout();
  return std::sqrt(squares / kFrames);
}

TEST(TrackerShutter, KnowsWhereTheCameraWasWhenEachRowWasExposed) {
  const double known = error_with(kReadout);
  const double ignored = error_with(0);
  EXPECT_LT(known, 0.006);
  EXPECT_GT(ignored, 3 * known);
}

/// What is taken for the motion within a frame is that since the one before: where the camera speeds up or
/// slows down, that is wrong, and bends all of the image alike.
TEST(TrackerShutter, PosesAreKnownNoBetterThanTheMotionWithinAFrame) {
  Rig rig = test_rig(SensorKind::kStereo, 320, 240);
  rig.readout = kReadout;
  Odometry odometry(rig);
  std::map<KeyframeId, int> frame_of;
  double nees = 0;
  int count = 0;
  for (int i = 0; i < kFrames; ++i) {
    const TrackResult result = odometry.step(shaken_frames()[static_cast<std::size_t>(i)]);
    if (i > 0) {
      const SE3 truth =
          shaken_T_c_w(i * kInterval) * shaken_T_c_w(frame_of.at(result.reference) * kInterval).inverse();
      const Vector6 error = (result.T_c_ref * truth.inverse()).log();
      nees += error.dot(result.information * error) / 6;
      ++count;
    }
    if (result.proposed) frame_of[odometry.proposal().id] = i;
  }
  std::printf("NEES / 6 %.2f\n", nees / count);
  EXPECT_GT(nees / count, 0.3);
  EXPECT_LT(nees / count, 3);
}

TEST(TrackerShutter, FindsTheReadoutThatNobodyGave) {
  error_with(0);
  EXPECT_EQ(found.pairs, 0);  // 0 says that there is none
  error_with(std::nullopt);
  EXPECT_TRUE(found.significant);
  EXPECT_NEAR(found.seconds, kReadout, 4 * found.sigma);
  EXPECT_LT(found.sigma, 0.003);
}

}  // namespace
}  // namespace twofold
