#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "io/files/calibration_file.hpp"
#include "io/files/trajectory_file.hpp"
#include "io/sources/open_source.hpp"

namespace twofold {
namespace {

struct Expected {
  const char* folder;
  SensorKind kind;
  int width, height, frames;
  double fx, cx, baseline;  ///< fx 0: rectified here, checked elsewhere
  std::size_t truth;
};

TEST(RealRecordings, OpenWithTheRightRigs) {
  const char* root = std::getenv("TWOFOLD_DATA");
  if (!root) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const Expected recordings[] = {
      {"stereo_kitti06_51", SensorKind::kStereo, 1226, 370, 51, 707.0912, 601.8873, 0.5371507, 51},
      {"stereo_zed_office_195", SensorKind::kStereo, 640, 360, 195, 261.6347, 319.2386, 0.120006, 0},
      {"rgbd_7scenes_redkitchen_334", SensorKind::kRgbd, 640, 480, 334, 585, 320, 0.08, 334},
      {"stereo_euroc_v101_keyframes_100", SensorKind::kStereo, 752, 480, 100, 0, 0, 0.11007, 100}};
  for (const Expected& r : recordings) {
    const auto source = open_source((std::filesystem::path(root) / r.folder).string());
    const Rig& rig = source->rig();
    EXPECT_EQ(rig.kind, r.kind) << r.folder;
    EXPECT_EQ(rig.camera.width, r.width) << r.folder;
    EXPECT_EQ(rig.camera.height, r.height) << r.folder;
    EXPECT_NEAR(rig.baseline, r.baseline, 1e-4) << r.folder;
    if (r.fx > 0) {
      EXPECT_NEAR(rig.camera.fx, r.fx, 1e-4) << r.folder;
      EXPECT_NEAR(rig.camera.cx, r.cx, 1e-4) << r.folder;
    }
    EXPECT_EQ(source->frame_count(), r.frames) << r.folder;
    EXPECT_EQ(source->ground_truth().size(), r.truth) << r.folder;
    Frame frame;
    for (int i = 0; i < 3; ++i) EXPECT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  }
}

/// The camera's place must not depend on rectification, which only turns it.
TEST(RealRecordings, EurocTruthIsOfTheCameraNotTheBody) {
  const char* root = std::getenv("TWOFOLD_DATA");
  if (!root) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto folder = std::filesystem::path(root) / "stereo_euroc_v101_keyframes_100";
  const auto truth = open_source(folder.string())->ground_truth();
  const auto raw = read_tum_trajectory(folder / "groundtruth_cam0_tum.txt");
  ASSERT_EQ(truth.size(), raw.size());
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_LT((truth[i].T_w_c.translation() - raw[i].T_w_c.translation()).norm(), 1e-5);
    EXPECT_LT((truth[i].T_w_c.so3().inverse() * raw[i].T_w_c.so3()).log().norm(), 0.05);
  }
}

/// Written by OpenCV's own program of its own chessboards.
TEST(RealRecordings, OpenCvsCalibrationIsRead) {
  const char* root = std::getenv("TWOFOLD_DATA");
  if (!root) GTEST_SKIP() << "TWOFOLD_DATA is not set";
  const auto file = std::filesystem::path(root) / "calib_opencv_chessboard_13pairs/left_intrinsics.yml";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file;
  const Calibration c = read_calibration(file);
  EXPECT_EQ(c.kind, SensorKind::kMono);
  EXPECT_EQ(c.invalid_reason(), "");
  EXPECT_NEAR(c.left.pinhole.fx, 535.91573396, 1e-6);
  EXPECT_NEAR(c.left.pinhole.cy, 235.57082910, 1e-6);
  EXPECT_EQ(c.left.pinhole.width, 640);
  EXPECT_EQ(c.left.distortion.model, DistortionModel::kRadTan);
  EXPECT_NEAR(c.left.distortion.coefficients[4], 0.23839153, 1e-8);
}

}  // namespace
}  // namespace twofold
