#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "tests/io/scratch_folder.hpp"
#include "twofold/opencv.hpp"
#include "twofold/rectifier.hpp"
#include "twofold/source.hpp"

namespace twofold {
namespace {

constexpr const char* kRectifiedPair = R"(sensor: stereo
baseline: 0.1
cameras:
  - size: [64, 48]
    intrinsics: [50, 50, 31.5, 23.5]
)";
/// A right camera that is turned by 0.05 rad about its x axis.
constexpr const char* kTurnedPair = R"(sensor: stereo
cameras:
  - size: [64, 48]
    intrinsics: [50, 50, 31.5, 23.5]
  - size: [64, 48]
    intrinsics: [50, 50, 31.5, 23.5]
T_right_left: [1, 0, 0, -0.1,  0, 0.99875026, -0.04997917, 0,  0, 0.04997917, 0.99875026, 0,  0, 0, 0, 1]
)";

/// Brightness grows downwards, four grey levels a row.
cv::Mat ramp() {
  cv::Mat image(48, 64, CV_8UC1);
  for (int v = 0; v < image.rows; ++v) image.row(v).setTo(4 * v);
  return image;
}

TEST(FrameRectifier, RectifiedImagesAreTheSameOnes) {
  const ScratchFolder folder;
  folder.write("stereo.yaml", kRectifiedPair);
  const FrameRectifier rectifier(folder / "stereo.yaml");
  EXPECT_EQ(rectifier.rig().width, 64);
  EXPECT_DOUBLE_EQ(rectifier.rig().baseline, 0.1);
  FrameView frame;
  const cv::Mat image = ramp();
  frame = rectifier.rectify(stereo_frame(7, image, image));
  EXPECT_EQ(frame.t_ns, 7);
  EXPECT_EQ(frame.left.data, image.data);
  EXPECT_TRUE(frame.owner);
}

/// Blue, green and red of a pixel.
cv::Vec3b colour_at(const ImageView& view, int u, int v) {
  const auto* row = static_cast<const std::uint8_t*>(view.data) + v * view.stride;
  return {row[3 * u], row[3 * u + 1], row[3 * u + 2]};
}

const cv::Vec3b kColour{10, 100, 200};

TEST(FrameRectifier, TheLeftImageKeepsItsColoursForWhoWantsThem) {
  for (const char* calibration : {kRectifiedPair, kTurnedPair}) {
    const ScratchFolder folder;
    folder.write("stereo.yaml", calibration);
    const FrameRectifier rectifier(folder / "stereo.yaml");
    const cv::Mat image(48, 64, CV_8UC3, cv::Scalar(kColour));
    FrameView raw = stereo_frame(7, image, image);
    raw.left.format = raw.right.format = ImageFormat::kRgb8;
    const FrameView frame = rectifier.rectify_in_colour(raw);
    ASSERT_EQ(frame.left.format, ImageFormat::kBgr8);
    ASSERT_EQ(frame.left.width, rectifier.rig().width);
    EXPECT_EQ(colour_at(frame.left, 32, 24), cv::Vec3b(kColour[2], kColour[1], kColour[0]));
    EXPECT_EQ(frame.right.format, ImageFormat::kGrey8);
    const cv::Mat grey = ramp();
    EXPECT_EQ(rectifier.rectify_in_colour(stereo_frame(8, grey, grey)).left.format, ImageFormat::kGrey8);
  }
}

TEST(PublicSource, AFrameIsToBeHadInColourIfTheRecordingIs) {
  const ScratchFolder folder;
  for (const char* camera : {"image_2", "image_3"}) {
    std::filesystem::create_directory(folder.path() / camera);
    for (const char* name : {"000000.png", "000001.png"})
      cv::imwrite(folder / (std::string(camera) + "/" + name), cv::Mat(48, 64, CV_8UC3, cv::Scalar(kColour)));
  }
  folder.write("times.txt", "0.0\n0.1\n");
  folder.write("calib.txt", "P2: 50 0 31.5 0 0 50 23.5 0 0 0 1 0\nP3: 50 0 31.5 -5 0 50 23.5 0 0 0 1 0\n");
  Source source("kitti:" + folder.path().string());
  FrameView first, second;
  ASSERT_TRUE(source.next(first) && source.next(second));
  EXPECT_EQ(first.left.format, ImageFormat::kGrey8);
  const FrameView coloured = source.in_colour(first);
  first = {};
  ASSERT_EQ(coloured.left.format, ImageFormat::kBgr8);
  EXPECT_EQ(coloured.t_ns, 0);
  EXPECT_EQ(colour_at(coloured.left, 5, 7), kColour);
  ASSERT_NE(coloured.right.data, nullptr);
  EXPECT_GT(static_cast<const std::uint8_t*>(coloured.right.data)[0], 0) << "the frame's pixels are kept";
}

TEST(FrameRectifier, ATurnedCameraIsTurnedBack) {
  const ScratchFolder folder;
  folder.write("stereo.yaml", kTurnedPair);
  const FrameRectifier rectifier(folder / "stereo.yaml");
  const cv::Mat image = ramp();
  const FrameView frame = rectifier.rectify(stereo_frame(0, image, image));
  ASSERT_EQ(frame.right.width, rectifier.rig().width);
  const auto middle = [](const ImageView& view) {
    return static_cast<const std::uint8_t*>(view.data)[(view.height / 2) * view.stride + view.width / 2];
  };
  // Half a turn each, 0.05 rad apart: 2.5 rows of 4 grey levels at f = 50, times what the focal length
  // became.
  EXPECT_NEAR(std::abs(middle(frame.left) - middle(frame.right)), 4 * 0.05 * 50, 2);
}

TEST(FrameRectifier, SaysWhatIsWrong) {
  const ScratchFolder folder;
  folder.write("stereo.yaml", kRectifiedPair);
  EXPECT_THROW(FrameRectifier(folder / "none.yaml"), std::runtime_error);
  const FrameRectifier rectifier(folder / "stereo.yaml");
  const cv::Mat image = ramp();
  EXPECT_THROW((void)rectifier.rectify(stereo_frame(0, image, {})), std::invalid_argument);
  const cv::Mat colour(image.size(), CV_8UC3);
  EXPECT_THROW((void)rectifier.rectify(stereo_frame(0, image, colour)), std::invalid_argument);
  EXPECT_THROW((void)rectifier.rectify(stereo_frame(0, image, image.rowRange(0, 20))), std::invalid_argument);
}

TEST(FrameRectifier, TakesOneCameraAlone) {
  const ScratchFolder folder;
  folder.write("one.yaml",
               "sensor: mono\ncameras:\n  - size: [64, 48]\n    intrinsics: [50, 50, 31.5, 23.5]\n");
  const FrameRectifier rectifier(folder / "one.yaml");
  EXPECT_EQ(rectifier.rig().sensor, Sensor::kMono);
  const FrameView frame = rectifier.rectify(mono_frame(5, ramp()));
  EXPECT_EQ(frame.t_ns, 5);
  EXPECT_NE(frame.left.data, nullptr);
  EXPECT_EQ(frame.right.data, nullptr);
}

std::string euroc_camera(const char* T_BS) {
  return std::string("sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [") + T_BS +
         "]\nrate_hz: 20\nresolution: [64, 48]\ncamera_model: pinhole\n"
         "intrinsics: [50, 50, 31.5, 23.5]\ndistortion_model: radial-tangential\n"
         "distortion_coefficients: [0, 0, 0, 0]\n";
}

/// Two cameras, the right one turned by 0.05 rad about its x axis, with two images each.
void write_euroc(const ScratchFolder& folder) {
  const char* const left = "1, 0, 0, 0,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1";
  const char* const right =
      "1, 0, 0, 0.1,  0, 0.99875026, 0.04997917, 0,  0, -0.04997917, 0.99875026, 0,  0, 0, 0, 1";
  for (const std::string camera : {"cam0", "cam1"}) {
    std::filesystem::create_directories(folder.path() / camera / "data");
    folder.write(camera + "/sensor.yaml", euroc_camera(camera == "cam0" ? left : right));
    folder.write(camera + "/data.csv", "#timestamp [ns],filename\n10,10.png\n20,20.png\n");
    for (const char* image : {"10.png", "20.png"})
      cv::imwrite((folder.path() / camera / "data" / image).string(), ramp());
  }
}

/// EuRoC has a file a camera: one of a pair's two says nothing of how the pair is rectified.
TEST(FrameRectifier, OneFileOfAPairIsRefusedAndTheFolderGivesBoth) {
  const ScratchFolder folder;
  write_euroc(folder);
  try {
    const FrameRectifier rectifier(folder / "cam0/sensor.yaml");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find("is of one camera of a pair"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("cam1/sensor.yaml"), std::string::npos);
  }
  const FrameRectifier pair(folder.path());
  EXPECT_EQ(pair.rig().sensor, Sensor::kStereo);
  EXPECT_NEAR(std::abs(pair.T_rectified_raw().q[0]), std::sin(0.05 / 4), 1e-6) << "half of the turn";
  const FrameRectifier alone(folder.path(), 0, 0, true);
  EXPECT_EQ(alone.rig().sensor, Sensor::kMono);
  EXPECT_EQ(alone.T_rectified_raw(), Pose{});
  std::filesystem::remove_all(folder.path() / "cam1");
  EXPECT_EQ(FrameRectifier(folder / "cam0/sensor.yaml").rig().sensor, Sensor::kMono);
}

TEST(FrameRectifier, ASourceSaysWhatItUsesItself) {
  const ScratchFolder folder;
  write_euroc(folder);
  const std::string name = "euroc:" + folder.path().string();
  const Pose T = FrameRectifier(folder.path()).T_rectified_raw();
  EXPECT_NE(T, Pose{});
  EXPECT_EQ(Source(name).T_rectified_raw(), T);
  EXPECT_EQ(Source(name, {.preload = true}).T_rectified_raw(), T);
  EXPECT_EQ(Source(name, {.left_only = true}).T_rectified_raw(), T)
      << "its left images are those of the pair";
  EXPECT_EQ(Source("synthetic:desk?frames=1&width=64&height=48").T_rectified_raw(), Pose{});
}

TEST(FrameRectifier, TheRawCameraIsTurnedAgainstTheRectifiedOne) {
  const ScratchFolder folder;
  folder.write("stereo.yaml", kRectifiedPair);
  EXPECT_EQ(FrameRectifier(folder / "stereo.yaml").T_rectified_raw(), Pose{});
  folder.write("turned.yaml", kTurnedPair);
  const FrameRectifier rectifier(folder / "turned.yaml");
  const Pose T = rectifier.T_rectified_raw();
  EXPECT_EQ(T.t, (std::array<double, 3>{}));
  // A ray of the raw left image is seen by the rectified camera where its pixels are found.
  const Pose T_world_raw = compose(Pose{}, T);
  const auto ray = transform(T_world_raw, {0, 0, 1});
  const CameraRig& rig = rectifier.rig();
  const double row = rig.cy + rig.fy * ray[1] / ray[2];
  const cv::Mat image = ramp();
  const FrameView rectified = rectifier.rectify(stereo_frame(1, image, image));
  const auto* pixels = static_cast<const std::uint8_t*>(rectified.left.data);
  const int v = static_cast<int>(std::lround(row)), u = static_cast<int>(std::lround(rig.cx));
  ASSERT_TRUE(v >= 0 && v < rig.height);
  EXPECT_NEAR(pixels[v * rectified.left.stride + u], 4 * 23.5, 4) << "the raw image's principal point";
  EXPECT_GT(std::abs(T.q[0]), 0.01) << "it is turned about x";
}

}  // namespace
}  // namespace twofold
