// Depth in recordings of ROS: its partner in time, its unit, its camera.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "io/sources/open_source.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr MessageEncoding kRos1 = MessageEncoding::kRos1;
constexpr const char* kColour = "/camera/rgb/image_color";
constexpr const char* kDepth = "/camera/depth/image";

/// Grey levels and depths [mm] are the images' numbers; 0: colour, 1: depth.
class RgbdBag {
 public:
  explicit RgbdBag(std::string depth_topic = kDepth) {
    bag_.topics = {
        {kColour, "sensor_msgs/Image"},
        {depth_topic, "sensor_msgs/Image"},
        {"/camera/rgb/camera_info", "sensor_msgs/CameraInfo"},
        {depth_topic.substr(0, depth_topic.rfind('/')) + "/camera_info", "sensor_msgs/CameraInfo"}};
    bag_.messages.push_back({2, time_of(0), camera_info_message(kRos1, rectified_info(false))});
  }
  void depth_info(const WrittenCameraInfo& info) {
    bag_.messages.push_back({3, time_of(0), camera_info_message(kRos1, info)});
  }
  void colour(int number, std::int64_t t) {
    const cv::Mat image(kHeight, kWidth, CV_8UC1, cv::Scalar(number));
    bag_.messages.push_back({0, t, image_message(kRos1, t, image, "mono8")});
  }
  void depth(int number, std::int64_t t) {
    const cv::Mat image(kHeight, kWidth, CV_16UC1, cv::Scalar(number));
    bag_.messages.push_back({1, t, image_message(kRos1, t, image, "16UC1")});
  }
  void depth_in_metres(float metres, std::int64_t t) {
    const cv::Mat image(kHeight, kWidth, CV_32FC1, cv::Scalar(metres));
    bag_.messages.push_back({1, t, image_message(kRos1, t, image, "32FC1")});
  }
  /// The source's text.
  [[nodiscard]] std::string write(const ScratchFolder& folder) const {
    folder.write("a.bag", text_of(rosbag_file(bag_, {})));
    return "bag:" + (folder / "a.bag");
  }

 private:
  WrittenBag bag_;
};

std::int64_t at(double seconds) {
  return time_of(0) + std::llround(seconds * 1e9);
}

/// The pairs that a source gives: numbers of the colour image and of the depth image.
std::vector<std::pair<int, int>> pairs(FrameSource& source) {
  std::vector<std::pair<int, int>> list;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;)
    list.emplace_back(frame.left.at<unsigned char>(5, 5), frame.depth.at<std::uint16_t>(5, 5));
  EXPECT_EQ(source.error(), "");
  return list;
}

/// At such rates the image before lies within the usual gap, too.
TEST(BagDepth, OneMoreDepthImageAtTheBeginningShiftsNoPair) {
  constexpr int kImages = 40;
  for (const double rate : {60.0, 90.0, 200.0}) {
    for (const double late : {0.0, 0.3, -0.3}) {
      SCOPED_TRACE(fmt::format("{} Hz, late by {} of it", rate, late));
      const ScratchFolder folder;
      RgbdBag bag;
      bag.depth(1000, at((late - 1) / rate));
      for (int i = 0; i < kImages; ++i) {
        bag.depth(i, at((i + late) / rate));
        bag.colour(i, at(i / rate));
      }
      const std::string text = bag.write(folder);
      for (const std::string query : {"", "?max_gap=0.016"}) {
        const auto source = open_source(text + query);
        const auto list = pairs(*source);
        EXPECT_EQ(list.size(), static_cast<std::size_t>(kImages)) << query;
        for (const auto& [colour, depth] : list) EXPECT_EQ(colour, depth) << query;
        EXPECT_EQ(source->report().lost, 1U);
      }
    }
  }
}

/// Of a colour image and the depth image after it that both lack their partners no pair is made, in the
/// middle and at the end.
TEST(BagDepth, ImagesWithoutAPartnerAreNoPairAtHighRates) {
  const ScratchFolder folder;
  RgbdBag bag;
  for (int i = 0; i < 40; ++i) {
    if (i != 21 && i != 39) bag.colour(i, at(i / 90.0));
    if (i != 20 && i != 38) bag.depth(i, at(i / 90.0));
  }
  const auto source = open_source(bag.write(folder));
  const auto list = pairs(*source);
  EXPECT_EQ(list.size(), 36U);
  for (const auto& [colour, depth] : list) EXPECT_EQ(colour, depth);
}

/// A recorder may write one topic's images well behind the other's.
TEST(BagDepth, ATopicThatIsWrittenLaterIsPairedAllTheSame) {
  const ScratchFolder folder;
  RgbdBag bag;
  constexpr int kBehind = 63, kImages = 150;
  for (int i = 0; i < kImages + kBehind; ++i) {
    if (i < kImages) bag.colour(i, at(i / 30.0));
    if (i >= kBehind) bag.depth(i - kBehind, at((i - kBehind) / 30.0 - 0.005));
  }
  const auto source = open_source(bag.write(folder));
  const auto list = pairs(*source);
  EXPECT_EQ(list.size(), static_cast<std::size_t>(kImages));
  for (const auto& [colour, depth] : list) EXPECT_EQ(colour, depth);
  EXPECT_EQ(source->report().lost, 0U);
}

TEST(BagDepth, TheUnitIsWhatTheCalibrationSays) {
  const ScratchFolder folder;
  RgbdBag bag;
  bag.colour(0, at(0));
  bag.depth(4000, at(0));
  bag.colour(1, at(0.1));
  bag.depth_in_metres(2, at(0.1));  // in metres whatever the others are
  const std::string text = bag.write(folder);
  const auto depths = [](FrameSource& source) {
    std::vector<double> metres;
    for (const auto& [colour, depth] : pairs(source)) metres.push_back(depth * source.rig().depth_unit);
    return metres;
  };
  const std::string camera = "sensor: rgbd\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n";
  SourceOptions stated, unstated;
  stated.calibration = folder.write("stated.yaml", camera + "depth: {unit: 0.0005}\n");
  unstated.calibration = folder.write("unstated.yaml", camera + "depth: {max: 5}\n");
  EXPECT_EQ(depths(*open_source(text, stated)), (std::vector<double>{2, 2}));
  EXPECT_EQ(depths(*open_source(text, unstated)), (std::vector<double>{4, 2}));
  EXPECT_EQ(depths(*open_source(text)), (std::vector<double>{4, 2}));
  EXPECT_EQ(depths(*open_source(text + "?depth_scale=2000")), (std::vector<double>{2, 2}));
  EXPECT_EQ(depths(*open_source(text + "?fx=50&fy=50&cx=32&cy=24&depth_scale=2000")),
            (std::vector<double>{2, 2}));
}

RgbdBag bag_with_depth_info(const WrittenCameraInfo& info, const std::string& topic = kDepth) {
  RgbdBag bag(topic);
  bag.depth_info(info);
  for (int i = 0; i < 3; ++i) {
    bag.colour(i, at(0.1 * i));
    bag.depth(1000, at(0.1 * i));
  }
  return bag;
}

/// As a depth sensor's driver publishes depth that nobody asked it to register.
TEST(BagDepth, OfAnotherCameraIsRefusedUnlessSomethingSaysHowItStands) {
  WrittenCameraInfo other = rectified_info(false);
  other.K[0] = other.K[4] = other.P[0] = other.P[5] = 46;
  const ScratchFolder folder;
  const std::string text = bag_with_depth_info(other).write(folder);
  EXPECT_IO_ERROR(open_source(text), "'/camera/depth/image' are of another camera");
  EXPECT_IO_ERROR(open_source(text), "--calib with the depth camera");
  const std::string lens = "sensor: rgbd\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24]}\n";
  SourceOptions options;
  options.calibration = folder.write("lens.yaml", lens);
  EXPECT_IO_ERROR(open_source(text, options), "are of another camera");
  options.calibration = folder.write(
      "both.yaml", lens +
                       "depth:\n  size: [64, 48]\n  intrinsics: [46, 46, 32, 24]\n"
                       "  T_left_depth: [1, 0, 0, -0.03,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]\n");
  EXPECT_EQ(drain(*open_source(text, options)), "3");
  EXPECT_EQ(drain(*open_source(text + "?fx=50&fy=50&cx=32&cy=24")), "3");
  SourceOptions one_camera;
  one_camera.left_only = true;
  EXPECT_EQ(drain(*open_source(text, one_camera)), "3");
}

TEST(BagDepth, OfAnotherSizeIsRefusedWithTheSameWords) {
  WrittenCameraInfo other = rectified_info(false);
  other.width = 32;
  other.height = 24;
  const ScratchFolder folder;
  EXPECT_IO_ERROR(open_source(bag_with_depth_info(other).write(folder)), "are of another camera");
}

/// Registered depth comes with the colour camera's numbers, or nearly so, or with none.
TEST(BagDepth, OfTheColourCameraIsTaken) {
  WrittenCameraInfo same = rectified_info(false), near = same, empty, raw = same;
  near.K[0] = near.K[4] = near.P[0] = near.P[5] = 50.4;
  raw.P[0] = raw.P[5] = 40;  // registered to the raw image, whose rectified one would be wider
  for (const WrittenCameraInfo& info : {same, near, empty, raw}) {
    const ScratchFolder folder;
    EXPECT_EQ(
        drain(*open_source(bag_with_depth_info(info, "/camera/depth_registered/image_raw").write(folder))),
        "3");
  }
}

}  // namespace
}  // namespace twofold
