#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "fixtures/bag_writer.hpp"
#include "geometry/so3.hpp"
#include "tests/io/scratch_folder.hpp"
#include "twofold/calibration.hpp"
#include "twofold/opencv.hpp"
#include "twofold/rectifier.hpp"
#include "twofold/source.hpp"

namespace twofold {
namespace {

constexpr int kRawWidth = 64, kRawHeight = 48;

/// Every pixel differs from its neighbours.
cv::Mat noise(int type, int seed) {
  cv::Mat image(kRawHeight, kRawWidth, type);
  cv::RNG(static_cast<std::uint64_t>(seed)).fill(image, cv::RNG::UNIFORM, 1, 256);
  return image;
}

bool same_pixels(const ImageView& a, const ImageView& b) {
  if (a.width != b.width || a.height != b.height || a.format != b.format) return false;
  const int type = a.format == ImageFormat::kDepth16 ? CV_16UC1 : CV_8UC1;
  const auto image = [&](const ImageView& view) {
    return cv::Mat(view.height, view.width, type, const_cast<void*>(view.data),
                   static_cast<std::size_t>(view.stride));
  };
  return (a.data == nullptr) == (b.data == nullptr) &&
         (!a.data || cv::norm(image(a), image(b), cv::NORM_INF) == 0);
}

void expect_same_rig(const CameraRig& a, const CameraRig& b) {
  EXPECT_EQ(a.sensor, b.sensor);
  EXPECT_EQ(a.width, b.width);
  EXPECT_EQ(a.height, b.height);
  for (const auto member :
       {&CameraRig::fx, &CameraRig::fy, &CameraRig::cx, &CameraRig::cy, &CameraRig::baseline,
        &CameraRig::depth_unit, &CameraRig::depth_min, &CameraRig::depth_max})
    EXPECT_NEAR(a.*member, b.*member, 1e-9);
  EXPECT_EQ(a.readout, b.readout);
}

/// Both make the same of the same images, byte for byte, and not what came in.
void expect_same(const FrameRectifier& numbers, const FrameRectifier& file) {
  expect_same_rig(numbers.rig(), file.rig());
  FrameView raw;
  const cv::Mat left = noise(CV_8UC1, 1), right = noise(CV_8UC1, 2), depth = noise(CV_16UC1, 3);
  switch (file.rig().sensor) {
    case Sensor::kMono:
      raw = mono_frame(5, left);
      break;
    case Sensor::kStereo:
      raw = stereo_frame(5, left, right);
      break;
    case Sensor::kRgbd:
      raw = rgbd_frame(5, left, depth);
      break;
  }
  const FrameView a = numbers.rectify(raw), b = file.rectify(raw);
  EXPECT_TRUE(same_pixels(a.left, b.left));
  EXPECT_TRUE(same_pixels(a.right, b.right));
  EXPECT_TRUE(same_pixels(a.depth, b.depth));
  EXPECT_FALSE(same_pixels(a.left, raw.left)) << "nothing was rectified";
}

CameraInfo info_of(const std::string& model, const std::vector<double>& D) {
  return {kRawWidth, kRawHeight, model, D, {50, 0, 31.25, 0, 51, 23.75, 0, 0, 1}};
}

/// As ROS keeps camera_info in a file.
std::string ros_file(const CameraInfo& info) {
  std::string D;
  for (const double k : info.D) D += (D.empty() ? "" : ", ") + std::to_string(k);
  return "image_width: 64\nimage_height: 48\ncamera_matrix: {rows: 3, cols: 3, data: [50, 0, 31.25, 0, 51, "
         "23.75, 0, 0, 1]}\ndistortion_model: " +
         info.distortion_model +
         "\ndistortion_coefficients: {rows: 1, cols: " + std::to_string(info.D.size()) + ", data: [" + D +
         "]}\n";
}

const std::vector<CameraInfo>& lenses() {
  static const std::vector<CameraInfo> kLenses{
      info_of("plumb_bob", {-0.2, 0.03, 0.001, -0.002, 0.01}),
      info_of("rational_polynomial", {0.3, -0.1, 0.001, -0.002, 0.02, 0.4, -0.05, 0.03}),
      info_of("equidistant", {0.02, -0.01, 0.003, -0.001})};
  return kLenses;
}

TEST(CameraNumbers, OneCameraIsRectifiedAsByItsFile) {
  const ScratchFolder folder;
  for (const CameraInfo& info : lenses()) {
    SCOPED_TRACE(info.distortion_model);
    folder.write("camera.yaml", ros_file(info));
    expect_same(FrameRectifier(info), FrameRectifier(folder / "camera.yaml"));
  }
}

TEST(CameraNumbers, ADepthCamerasImagesGoTheSameWay) {
  const ScratchFolder folder;
  folder.write("rgbd.yaml",
               "sensor: rgbd\ncameras:\n  - size: [64, 48]\n    intrinsics: [50, 51, 31.25, 23.75]\n"
               "    distortion: {model: radtan, coefficients: [-0.2, 0.03, 0.001, -0.002, 0.01]}\n");
  expect_same(FrameRectifier(lenses()[0], Sensor::kRgbd), FrameRectifier(folder / "rgbd.yaml"));
}

TEST(CameraNumbers, APairIsRectifiedAsByItsFile) {
  const ScratchFolder folder;
  folder.write("stereo.yaml", R"(sensor: stereo
cameras:
  - size: [64, 48]
    intrinsics: [50, 51, 31.25, 23.75]
    distortion: {model: radtan, coefficients: [-0.2, 0.03, 0.001, -0.002, 0.01]}
  - size: [64, 48]
    intrinsics: [50, 51, 31.25, 23.75]
    distortion: {model: equidistant, coefficients: [0.02, -0.01, 0.003, -0.001]}
T_right_left: [1, 0, 0, -0.1,  0, 0.96, -0.28, 0.005,  0, 0.28, 0.96, -0.002,  0, 0, 0, 1]
)");
  const Pose T_right_left{{std::sqrt(0.02), 0, 0, std::sqrt(0.98)}, {-0.1, 0.005, -0.002}};
  expect_same(FrameRectifier(lenses()[0], lenses()[2], T_right_left), FrameRectifier(folder / "stereo.yaml"));
}

/// A pair whose cameras are turned towards each other and stand apart in height, too.
std::pair<CameraInfo, CameraInfo> turned_pair() {
  CameraInfo left = lenses()[0], right = lenses()[2];
  const auto turn = [](const Vector3& by, CameraInfo* info) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info->R.data()) = SO3::exp(by).matrix();
  };
  turn({0.01, -0.02, 0.03}, &left);
  turn({-0.02, 0.01, 0.01}, &right);
  left.P = {52, 0, 32, 0, 0, 52, 24, 0, 0, 0, 1, 0};
  right.P = {52, 0, 32, -5.2, 0, 52, 24, 0.26, 0, 0, 1, 0};
  return {left, right};
}

/// The recording has the messages that a node would get.
TEST(CameraNumbers, APairWithoutAPoseIsRectifiedAsItsRecording) {
  const auto [left, right] = turned_pair();
  const cv::Mat left_image = noise(CV_8UC1, 1), right_image = noise(CV_8UC1, 2);
  testing::WrittenBag bag;
  bag.topics = {{"/left/image_raw", "sensor_msgs/Image"},
                {"/right/image_raw", "sensor_msgs/Image"},
                {"/left/camera_info", "sensor_msgs/CameraInfo"},
                {"/right/camera_info", "sensor_msgs/CameraInfo"}};
  constexpr auto kCdr = MessageEncoding::kCdr;
  for (std::uint32_t side : {0U, 1U}) {
    const CameraInfo& info = side == 0 ? left : right;
    bag.messages.push_back({2 + side, 0,
                            testing::camera_info_message(kCdr, {kRawWidth, kRawHeight, info.distortion_model,
                                                                info.D, info.K, info.R, info.P})});
    bag.messages.push_back(
        {side, 7, testing::image_message(kCdr, 7, side == 0 ? left_image : right_image, "mono8")});
  }
  const ScratchFolder folder;
  const testing::Bytes bytes = mcap_file(bag, {});
  Source source("mcap:" + folder.write("pair.mcap", {bytes.begin(), bytes.end()}).string());
  const FrameRectifier rectifier(left, right);
  expect_same_rig(rectifier.rig(), source.rig());
  EXPECT_NEAR(rectifier.rig().baseline, std::hypot(0.1, 0.005), 1e-12);
  EXPECT_EQ(rectifier.T_rectified_raw(), source.T_rectified_raw());
  FrameView recorded;
  ASSERT_TRUE(source.next(recorded));
  const FrameView frame = rectifier.rectify(stereo_frame(7, left_image, right_image));
  EXPECT_TRUE(same_pixels(frame.left, recorded.left));
  EXPECT_TRUE(same_pixels(frame.right, recorded.right));
}

TEST(CameraNumbers, WhatABoardGaveNeedsNoFile) {
  BoardCalibration board;
  board.left.width = kRawWidth;
  board.left.height = kRawHeight;
  board.left.fx = 50;
  board.left.fy = 51;
  board.left.cx = 31.25;
  board.left.cy = 23.75;
  board.left.distortion = {-0.2, 0.03, 0.001, -0.002};
  const ScratchFolder folder;
  save_calibration(board, folder / "one.yaml");
  expect_same(FrameRectifier(board), FrameRectifier(folder / "one.yaml"));
  board.right = board.left;
  board.right->fx = 49.5;
  board.T_right_left = {{std::sqrt(0.02), 0, 0, std::sqrt(0.98)}, {-0.1, 0.005, -0.002}};
  save_calibration(board, folder / "pair.yaml");
  expect_same(FrameRectifier(board), FrameRectifier(folder / "pair.yaml"));
  board.right->fx = 0;
  EXPECT_THROW(FrameRectifier{board}, std::invalid_argument);
}

std::string refusal(const std::function<void()>& make) {
  try {
    make();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing";
}

TEST(CameraNumbers, OneCameraThatMakesNoSenseIsRefusedWithItsNumber) {
  const auto expect = [](const std::string& words, const std::function<void(CameraInfo&)>& spoil) {
    CameraInfo info = lenses()[0];
    spoil(info);
    const std::string why = refusal([&] { (void)FrameRectifier(info); });
    EXPECT_NE(why.find(words), std::string::npos) << why;
  };
  expect("0 x 48", [](CameraInfo& info) { info.width = 0; });
  expect("-64 x 48", [](CameraInfo& info) { info.width = -64; });
  expect("fx must be positive, is -50", [](CameraInfo& info) { info.K[0] = -50; });
  expect("is [50, 0.1, 31.25,", [](CameraInfo& info) { info.K[1] = 0.1; });
  expect("is [0, 0, 0, 0, 0, 0, 0, 0, 0]", [](CameraInfo& info) { info.K = {}; });
  expect("cx, cy must be in or near the image [px], are 3100", [](CameraInfo& info) { info.K[2] = 3100; });
  expect("'plumb_bob' has 6 coefficients", [](CameraInfo& info) { info.D = {1, 1, 1, 1, 1, 1}; });
  expect("'spherical' is not known", [](CameraInfo& info) { info.distortion_model = "spherical"; });
  expect("coefficient 2 is not finite", [](CameraInfo& info) { info.D[1] = std::nan(""); });
  const std::string why = refusal([&] { (void)FrameRectifier(lenses()[0], Sensor::kStereo); });
  EXPECT_NE(why.find("a stereo pair needs two"), std::string::npos) << why;
}

TEST(CameraNumbers, APairThatMakesNoSenseIsRefusedWithItsNumber) {
  const auto expect = [](const std::string& words,
                         const std::function<void(CameraInfo&, CameraInfo&)>& spoil) {
    auto pair = turned_pair();
    spoil(pair.first, pair.second);
    const std::string why = refusal([&] { (void)FrameRectifier(pair.first, pair.second); });
    EXPECT_NE(why.find(words), std::string::npos) << why;
  };
  expect("right camera: K must be", [](CameraInfo&, CameraInfo& right) { right.K[4] = right.K[8] = 0; });
  expect("P[0]: 52 and 53", [](CameraInfo&, CameraInfo& right) { right.P[0] = 53; });
  expect("no baseline (P[3] is 0", [](CameraInfo&, CameraInfo& right) { right.P[3] = right.P[7] = 0; });
  expect("left camera: R is no rotation", [](CameraInfo& left, CameraInfo&) { left.R[0] = 0.5; });
  expect("52.0", [](CameraInfo&, CameraInfo& right) { right.P[3] = -52 * 52; });
  const auto pose = [](const Pose& T_right_left) {
    return refusal([&] { (void)FrameRectifier(lenses()[0], lenses()[2], T_right_left); });
  };
  EXPECT_NE(pose({{0, 0, 0, 2}, {-0.1, 0, 0}}).find("q [0, 0, 0, 2]"), std::string::npos);
  EXPECT_NE(pose({{0, 0, 0, 1}, {0.1, 0, 0}}).find("-0.1"), std::string::npos) << "left and right swapped";
}

}  // namespace
}  // namespace twofold
