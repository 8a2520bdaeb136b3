#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "tests/io/scratch_folder.hpp"
#include "twofold/opencv.hpp"
#include "twofold/rectifier.hpp"

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
