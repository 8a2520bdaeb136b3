#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include <fmt/format.h>

#include "fixtures/rendered_board.hpp"
#include "io/files/calibration_file.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

using namespace twofold::testing;

const Board kBoard{BoardKind::kChessboard, 9, 6, 0.025, 0, MarkerFamily::k4x4};

/// Images of both cameras of a pair, 16 views, in left/ and right/.
void render_pairs(const ScratchFolder& folder, const CameraModel& left, const CameraModel& right,
                  const SE3& T_r_l) {
  const BoardCamera left_camera(left), right_camera(right);
  const cv::Mat print = print_chessboard(kBoard);
  std::mt19937 random(8);
  for (int n = 0; n < 16;) {
    const SE3 T_l_b = random_pose(kBoard, 0.6, random);
    if (!sees(left, kBoard, T_l_b) || !sees(right, kBoard, T_r_l * T_l_b)) continue;
    const auto see = [&](const BoardCamera& camera, const SE3& T_c_b) {
      return camera.see(print, kPrintSquarePx / kBoard.square, {2 * kPrintSquarePx, 2 * kPrintSquarePx},
                        T_c_b, random);
    };
    folder.write_image(fmt::format("set/left/{:02}.png", n), see(left_camera, T_l_b));
    folder.write_image(fmt::format("set/right/{:02}.png", n), see(right_camera, T_r_l * T_l_b));
    ++n;
  }
}

TEST(CalibrateCommand, FolderOfPairsBecomesACalibrationThatCanBeRead) {
  const ScratchFolder folder;
  const CameraModel left = test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
  const CameraModel right = test_camera(457, 315.6, 243.8, -0.27, 0.069, -0.0003, 0.0003);
  render_pairs(folder, left, right, SE3(SO3(), Vector3(-0.06, 0, 0)));
  const std::string board = " --board chessboard:9x6:0.025 -o ";
  const Outcome stereo = run(folder, "calibrate " + (folder / "set") + board + (folder / "stereo.yaml"));
  ASSERT_EQ(stereo.exit_code, 0) << stereo.err;
  EXPECT_NE(stereo.out.find("baseline 0.0"), std::string::npos) << stereo.out;
  EXPECT_NE(stereo.err.find("Next: "), std::string::npos);
  EXPECT_FALSE(cv::imread(folder / "stereo.png").empty());
  const Calibration calibration = read_calibration(folder / "stereo.yaml");
  EXPECT_EQ(calibration.kind, SensorKind::kStereo);
  EXPECT_NEAR(calibration.left.pinhole.fx, 460, 0.92);
  EXPECT_NEAR(calibration.T_right_left.translation().x(), -0.06, 0.0003);
  EXPECT_NE(content(folder / "stereo.yaml").find("rms_px: 0."), std::string::npos);
  const Outcome mono =
      run(folder, "calibrate " + (folder / "set/left") + board + (folder / "mono.yaml") + " --quiet");
  ASSERT_EQ(mono.exit_code, 0) << mono.err;
  EXPECT_EQ(mono.err, "");
  EXPECT_EQ(read_calibration(folder / "mono.yaml").kind, SensorKind::kMono);

  for (int n = 5; n < 16; ++n) std::filesystem::remove(folder / fmt::format("set/left/{:02}.png", n));
  const Outcome few =
      run(folder, "calibrate " + (folder / "set/left") + board + (folder / "few.yaml") + " --quiet");
  EXPECT_EQ(few.exit_code, 1);
  EXPECT_NE(few.err.find("no calibration: too few views: 5"), std::string::npos) << few.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "few.yaml"));
}

/// Each pair of images for as long as somebody holds the board still.
void write_side_by_side(const ScratchFolder& folder, const std::string& name) {
  constexpr int kHeld = 7;  // frames
  cv::VideoWriter writer;
  for (int n = 0; n < 16; ++n) {
    cv::Mat both;
    cv::hconcat(cv::imread(folder / fmt::format("set/left/{:02}.png", n)),
                cv::imread(folder / fmt::format("set/right/{:02}.png", n)), both);
    if (n == 0)
      writer.open(folder / name, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25,
                  both.size());
    for (int i = 0; i < kHeld; ++i) writer.write(both);
  }
}

TEST(CalibrateCommand, AVideoOfTheBoardIsReadAsACamera) {
  const ScratchFolder folder;
  const CameraModel left = test_camera(460, 324.3, 237.1, -0.28, 0.074, 0.0002, -0.0004);
  const CameraModel right = test_camera(457, 315.6, 243.8, -0.27, 0.069, -0.0003, 0.0003);
  render_pairs(folder, left, right, SE3(SO3(), Vector3(-0.06, 0, 0)));
  write_side_by_side(folder, "pair.avi");
  const std::string video = "calibrate '" + (folder / "pair.avi") + "?layout=side-by-side'";
  const Outcome stereo =
      run(folder, video + " --views 10 --board chessboard:9x6:0.025 -o " + (folder / "stereo.yaml"));
  ASSERT_EQ(stereo.exit_code, 0) << stereo.err;
  const Calibration calibration = read_calibration(folder / "stereo.yaml");
  EXPECT_EQ(calibration.kind, SensorKind::kStereo);
  EXPECT_EQ(calibration.left.pinhole.width, 640);
  EXPECT_NEAR(calibration.left.pinhole.fx, 460, 2);
  EXPECT_NEAR(calibration.T_right_left.translation().x(), -0.06, 0.0006);
  expect_bad_input(
      run(folder, "calibrate synthetic:desk --board chessboard:9x6:0.025 -o " + (folder / "c.yaml")),
      "calibrate reads cameras (v4l2:), videos, and folders of images");
}

TEST(CalibrateCommand, BadInputIsOneLineAndExitCodeTwo) {
  const ScratchFolder folder;
  const std::string out = " -o " + (folder / "c.yaml");
  expect_bad_input(run(folder, "calibrate " + (folder / "none") + out + " --board chessboard:9x6:0.025"),
                   "none: no such folder");
  expect_bad_input(
      run(folder, "calibrate " + folder.path().string() + out + " --board aprilgrid:6x6:0.088:0.3"),
      "no AprilGrid");
  expect_bad_input(run(folder, "calibrate " + folder.path().string() + out + " --board chessboard:9x6"),
                   "the form is");
  expect_bad_input(run(folder, "calibrate " + folder.path().string() + out), "--board");
  expect_bad_input(run(folder, "calibrate " + folder.path().string() + " -o " + (folder / "cal.png") +
                                   " --board chessboard:9x6:0.025"),
                   "name it .yaml");
  std::filesystem::create_directory(folder.path() / "both");
  for (const char* name : {"both/left01.png", "both/right01.png", "both/left02.png"})
    cv::imwrite(folder / name, cv::Mat(48, 64, CV_8UC1, cv::Scalar(90)));
  expect_bad_input(run(folder, "calibrate " + (folder / "both") + out + " --board chessboard:9x6:0.025"),
                   "holds the images of two cameras (left01, right01)");
}

TEST(DoctorCommand, ReportsLineByLine) {
  const ScratchFolder folder;
  const Outcome here = run(folder, "doctor --record-to " + folder.path().string());
  for (const char* part : {"cores", "governor", "SCHED_FIFO", "locked memory", "MB/s"})
    EXPECT_NE(here.out.find(part), std::string::npos) << part << here.out;
  const Outcome absent = run(folder, "doctor 'v4l2:/dev/video97?size=640x480&fps=30'");
  EXPECT_EQ(absent.exit_code, 1);
  EXPECT_NE(absent.out.find("bad   /dev/video97"), std::string::npos) << absent.out;
  expect_bad_input(run(folder, "doctor 'v4l2:/dev/video97?size=huge'"), "size='huge'");
}

/// Bytes of all images of a frame, times the frames of a second.
TEST(DoctorCommand, ADiskIsComparedWithWhatTheSourceNeeds) {
  const ScratchFolder folder;
  const auto needs = [&](const std::string& source, const std::string& need) {
    const Outcome outcome = run(folder, "doctor " + source + " --record-to " + folder.path().string());
    EXPECT_NE(outcome.out.find("recording needs up to " + need + "\n"), std::string::npos) << outcome.out;
  };
  needs("", "18");
  needs("'synthetic:desk?frames=6&width=1280&height=960&fps=30'", "74");
  needs("'synthetic:desk?frames=6&width=1280&height=960&fps=15&sensor=mono'", "18");
  needs("'synthetic:desk?frames=6&width=1280&height=960&fps=15&sensor=rgbd'", "55");
  needs("'synthetic:desk?frames=1&width=1280&height=960&sensor=mono'", "37");
}

TEST(DoctorCommand, SaysThatImagesCannotBeRead) {
  const ScratchFolder folder;
  const std::string recording = folder / "recording";
  ASSERT_EQ(run(folder, "record 'synthetic:desk?frames=14&width=64&height=48' " + recording).exit_code, 0);
  std::vector<std::filesystem::path> images;
  for (const auto& entry : std::filesystem::directory_iterator(recording + "/mav0/cam1/data"))
    images.push_back(entry.path());
  std::sort(images.begin(), images.end());
  ASSERT_EQ(images.size(), 14U);
  EXPECT_NE(run(folder, "doctor " + recording).out.find("ok    images"), std::string::npos);
  std::filesystem::resize_file(images[3], 50);
  const Outcome one = run(folder, "doctor " + recording);
  EXPECT_NE(one.out.find("warn  images"), std::string::npos) << one.out;
  EXPECT_NE(one.out.find(images[3].filename().string()), std::string::npos) << one.out;
  for (const auto& image : images) std::filesystem::resize_file(image, 50);
  const Outcome all = run(folder, "doctor " + recording);
  EXPECT_EQ(all.exit_code, 1);
  EXPECT_NE(all.out.find("bad   images"), std::string::npos) << all.out;
}

TEST(DoctorCommand, LooksAtDepthImages) {
  const ScratchFolder folder;
  const std::string recording = folder / "recording";
  ASSERT_EQ(run(folder, "render 'synthetic:desk?sensor=rgbd&frames=14&width=64&height=48' --out " + recording)
                .exit_code,
            0);
  const Outcome fine = run(folder, "doctor tum:" + recording);
  EXPECT_NE(fine.out.find("ok    images"), std::string::npos) << fine.out;
  EXPECT_NE(fine.out.find("ok    depth "), std::string::npos) << fine.out;
  const Outcome wrong = run(folder, "doctor 'tum:" + recording + "?depth_scale=50'");
  EXPECT_NE(wrong.out.find("warn  depth "), std::string::npos) << wrong.out;
  EXPECT_NE(wrong.out.find("depth_scale"), std::string::npos) << wrong.out;
  std::filesystem::remove_all(recording + "/mav0/depth0/data");
  const Outcome none = run(folder, "doctor tum:" + recording);
  EXPECT_EQ(none.exit_code, 1);
  EXPECT_NE(none.out.find("depth0/data: the folder is not there"), std::string::npos) << none.out;
}

TEST(DoctorCommand, LooksAtOneCamerasImages) {
  const ScratchFolder folder;
  const Outcome fine = run(folder, "doctor 'synthetic:desk?sensor=mono&frames=6&width=64&height=48'");
  EXPECT_NE(fine.out.find("ok    images"), std::string::npos) << fine.out;
}

}  // namespace
}  // namespace twofold
