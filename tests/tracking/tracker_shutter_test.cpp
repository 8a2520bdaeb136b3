// A camera whose rows are exposed one after the other, turned quickly to and fro.
#include <gtest/gtest.h>

#include <cstdio>
#include <map>

#include "geometry/absolute_orientation.hpp"
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

/// Sideways before a corner of the room, at up to 0.9 m/s, looking about at up to 50 degrees a second.
SE3 walked_T_c_w(double seconds) {
  const double yaw = 0.75 + 0.2 * std::sin(4.4 * seconds), pitch = 0.05 * std::sin(5.6 * seconds);
  const Vector3 way(0.7 * std::sin(1.3 * seconds), 0.08 * std::sin(2.6 * seconds), 0.3 * seconds);
  return SE3(SO3::exp(Vector3(0, yaw, 0)) * SO3::exp(Vector3(pitch, 0, 0)),
             SO3::exp(Vector3(0, 0.75, 0)) * way)
      .inverse();
}

constexpr int kWalkedFrames = 60;

std::vector<cv::Mat> walked_images(double shutter) {
  std::vector<cv::Mat> images;
  const Rig rig = test_rig(SensorKind::kMono, 320, 240);
  RenderedScene scene(rig, {3, 2, 5}, 21);
  for (int i = 0; i < kWalkedFrames; ++i) {
    const auto T_c_w_of = [&](int row) {
      return walked_T_c_w(i * kInterval + ((row + 0.5) / rig.camera.height - 0.5) * shutter);
    };
    images.push_back(scene.render_rows(T_c_w_of, 2));
  }
  return images;
}

struct OneCameraWalk {
  std::size_t tracked = 0;
  double error = std::numeric_limits<double>::infinity();  ///< root mean square, scale aligned [m]
};

/// @param readout  that the calibration gives
OneCameraWalk walk_with_one_camera(const std::vector<cv::Mat>& images, double readout) {
  Rig rig = test_rig(SensorKind::kMono, 320, 240);
  rig.readout = readout;
  Odometry odometry(rig);
  std::vector<Vector3> estimated, truth;
  for (int i = 0; i < kWalkedFrames; ++i) {
    const auto t_ns = static_cast<std::int64_t>(i * kInterval * 1e9);
    const TrackResult result = odometry.step({i, t_ns, images[static_cast<std::size_t>(i)], {}, {}});
    if (result.status != TrackStatus::kTracking) continue;
    estimated.push_back(odometry.T_c_w(result).inverse().translation());
    truth.push_back(walked_T_c_w(i * kInterval).inverse().translation());
  }
  OneCameraWalk walk{.tracked = truth.size()};
  const auto S = truth.size() < 4 ? std::nullopt : align_similarity(truth, estimated);
  if (!S) return walk;
  double squares = 0;
  for (std::size_t n = 0; n < truth.size(); ++n) squares += (*S * estimated[n] - truth[n]).squaredNorm();
  walk.error = std::sqrt(squares / static_cast<double>(truth.size()));
  return walk;
}

TEST(TrackerShutter, OneCameraKnowsWhenEachRowWasExposed) {
  const OneCameraWalk global = walk_with_one_camera(walked_images(0), 0);
  const std::vector<cv::Mat> rolled = walked_images(kReadout);
  const OneCameraWalk known = walk_with_one_camera(rolled, kReadout);
  const OneCameraWalk ignored = walk_with_one_camera(rolled, 0);
  std::printf(
      "one camera: global shutter %.4f m, %zu tracked; rolling one %.4f m, %zu; ignored %.4f m, %zu\n",
      global.error, global.tracked, known.error, known.tracked, ignored.error, ignored.tracked);
  EXPECT_GE(known.tracked + 2, global.tracked);
  EXPECT_LT(known.error, 0.01);
  EXPECT_GT(ignored.error, 5 * known.error);
}

}  // namespace
}  // namespace twofold
