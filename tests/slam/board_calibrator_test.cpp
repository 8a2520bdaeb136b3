#include "twofold/calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "fixtures/rendered_board.hpp"
#include "tests/io/scratch_folder.hpp"
#include "twofold/opencv.hpp"
#include "twofold/rectifier.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

constexpr const char* kBoardText = "chessboard:9x6:0.025";  // kBoard
constexpr double kBaseline = 0.08;

CameraModel left_camera() {
  return test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
}
CameraModel right_camera() {
  return test_camera(457, 315.6, 243.8, -0.27, 0.069, -0.0003, 0.0003);
}

/// Frames of somebody who turns a board before a stereo camera.
class Person {
 public:
  /// Calls look with each of `count` frames.
  void show(BoardCalibrator& calibrator, int count, bool stereo, double tilt = 0.6) {
    const SE3 T_right_left(SO3::exp(Vector3(0.004, -0.012, 0.006)), Vector3(-kBaseline, 0, 0));
    for (int shown = 0; shown < count;) {
      const SE3 T_l_b = random_pose(kBoard, tilt, random_);
      const SE3 T_r_b = T_right_left * T_l_b;
      if (!sees(left_camera(), kBoard, T_l_b) || !sees(right_camera(), kBoard, T_r_b)) continue;
      const cv::Mat left = left_.see(print_, px_per_m_, origin_, T_l_b, random_);
      const cv::Mat right = right_.see(print_, px_per_m_, origin_, T_r_b, random_);
      ++shown;
      calibrator.look(stereo ? stereo_frame(shown, left, right) : mono_frame(shown, left));
    }
  }

 private:
  const BoardCamera left_{left_camera()}, right_{right_camera()};
  const cv::Mat print_ = print_chessboard(kBoard);
  const double px_per_m_ = kPrintSquarePx / kBoard.square;
  const cv::Point2d origin_{2 * kPrintSquarePx, 2 * kPrintSquarePx};
  std::mt19937 random_{3};
};

TEST(BoardCalibrator, APairIsFoundAndItsFileRectifiesIt) {
  BoardCalibrator calibrator({.board = kBoardText, .width = 640, .height = 480, .stereo = true});
  EXPECT_FALSE(calibrator.complete());
  EXPECT_THROW((void)calibrator.calibrate(), std::runtime_error) << "nothing was seen";
  Person().show(calibrator, 35, true);
  EXPECT_EQ(calibrator.frames(), 35);
  EXPECT_GT(calibrator.found(), 25);
  const BoardCalibration found = calibrator.calibrate();
  ASSERT_TRUE(found.right);
  EXPECT_LT(std::abs(found.left.fx - left_camera().pinhole.fx), 5 * found.left.fx_std + 0.5);
  EXPECT_LT(std::abs(found.right->cx - right_camera().pinhole.cx), 5 * found.right->cx_std + 0.5);
  EXPECT_LT(std::abs(found.baseline - kBaseline), 0.0005);
  EXPECT_NEAR(found.left.distortion[0], -0.28, 0.02);
  EXPECT_LT(found.rms_px, 0.3);
  EXPECT_EQ(found.left.corners.size(), static_cast<std::size_t>(found.left.views * kBoard.corner_count()));

  const ScratchFolder folder;
  save_calibration(found, folder.path() / "pair.yaml");
  const FrameRectifier rectifier(folder.path() / "pair.yaml");
  EXPECT_EQ(rectifier.rig().sensor, Sensor::kStereo);
  EXPECT_NEAR(rectifier.rig().baseline, found.baseline, 1e-6);
  EXPECT_THROW(save_calibration(found, folder.path() / "nowhere" / "pair.yaml"), std::runtime_error);
}

TEST(BoardCalibrator, OneCameraIsRefusedUntilItsViewsDo) {
  Person person;
  BoardCalibrator calibrator({.board = kBoardText, .width = 640, .height = 480});
  person.show(calibrator, 4, false);
  try {
    (void)calibrator.calibrate();
    FAIL() << "four views are too few";
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("no calibration"), std::string::npos) << error.what();
  }
  EXPECT_FALSE(calibrator.progress().empty());
  person.show(calibrator, 40, false);
  const BoardCalibration found = calibrator.calibrate();
  EXPECT_FALSE(found.right);
  EXPECT_LT(std::abs(found.left.fx - left_camera().pinhole.fx), 5 * found.left.fx_std + 0.5);
}

TEST(BoardCalibrator, OptionsAndFramesThatMakeNoSenseAreNamed) {
  const auto expect_refused = [](const BoardCalibrator::Options& options, const char* part) {
    try {
      BoardCalibrator refused(options);
      ADD_FAILURE() << part;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  const BoardCalibrator::Options valid{.board = kBoardText, .width = 640, .height = 480};
  EXPECT_EQ(valid.invalid_reason(), "");
  expect_refused({.board = "paper", .width = 640, .height = 480}, "options.board");
  expect_refused({.board = kBoardText, .width = 0, .height = 480}, "options.width");
  expect_refused({.board = kBoardText, .width = 640, .height = 480, .views = 3}, "options.views");
  BoardCalibrator calibrator({.board = kBoardText, .width = 640, .height = 480, .stereo = true});
  const cv::Mat image(480, 640, CV_8UC1, cv::Scalar(90)), small(240, 320, CV_8UC1, cv::Scalar(90));
  EXPECT_THROW(calibrator.look(mono_frame(1, image)), std::invalid_argument) << "no right image";
  EXPECT_THROW(calibrator.look(stereo_frame(1, image, small)), std::invalid_argument);
  calibrator.look(stereo_frame(1, image, image));
  EXPECT_EQ(calibrator.frames(), 1);
  EXPECT_EQ(calibrator.found(), 0);
}

}  // namespace
}  // namespace twofold
