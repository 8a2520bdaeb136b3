#include "io/sources/bag_source.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/sources/open_source.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

TEST(BagSource, GivesStereoPairsWithTheCalibrationOfTheBag) {
  const ScratchFolder folder;
  folder.write("ros2.mcap", text_of(mcap_file(stereo_bag(MessageEncoding::kCdr), {.compression = "zstd"})));
  folder.write("ros1.bag", text_of(rosbag_file(stereo_bag(MessageEncoding::kRos1), {.compression = "lz4"})));
  for (const std::string& text : {"mcap:" + (folder / "ros2.mcap"), "bag:" + (folder / "ros1.bag"),
                                  folder / "ros2.mcap", folder / "ros1.bag"}) {
    SCOPED_TRACE(text);
    const auto source = open_source(text);
    EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
    EXPECT_EQ(source->rig().camera.fx, 50);
    EXPECT_NEAR(source->rig().baseline, 0.2, 1e-12);
    Frame frame;
    for (int i = 0; i < kCount; ++i) {
      ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
      EXPECT_EQ(frame.index, i);
      EXPECT_EQ(frame.t_ns, time_of(i));
      EXPECT_EQ(frame.left.at<unsigned char>(0, 1), i);
      EXPECT_EQ(frame.right.at<unsigned char>(0, 1), 100 + i);
    }
    EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
    EXPECT_EQ(source->report().lost, 0U);
  }
}

TEST(BagSource, APartKeepsNumbersAndTimes) {
  const ScratchFolder folder;
  folder.write("a.mcap", text_of(mcap_file(stereo_bag(MessageEncoding::kCdr), {})));
  const auto source = open_source("mcap:" + (folder / "a.mcap") + "?first=1&frames=2");
  EXPECT_NEAR(source->rig().baseline, 0.2, 1e-12);
  Frame frame;
  for (int i = 1; i < 3; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.index, i);
    EXPECT_EQ(frame.t_ns, time_of(i));
    EXPECT_EQ(frame.right.at<unsigned char>(0, 1), 100 + i);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  const std::string beyond =
      drain(*open_source("mcap:" + (folder / "a.mcap") + "?first=" + std::to_string(kCount)));
  EXPECT_NE(beyond.find("frames, which count from 0"), std::string::npos) << beyond;
}

TEST(BagSource, OneCameraOfAPair) {
  const ScratchFolder folder;
  folder.write("a.mcap", text_of(mcap_file(stereo_bag(MessageEncoding::kCdr), {})));
  const auto source = open_source("mcap:" + (folder / "a.mcap") + "?left=/stereo/right/image_rect");
  EXPECT_EQ(source->rig().kind, SensorKind::kMono);
  EXPECT_EQ(drain(*source), std::to_string(kCount));
  EXPECT_IO_ERROR(open_source("mcap:" + (folder / "a.mcap") + "?left=/nothing"),
                  "no image topic '/nothing'; there are: /stereo/left/image_rect, /stereo/right/image_rect");
  EXPECT_IO_ERROR(open_source("mcap:" + (folder / "a.mcap") + "?colour=1"), "colour");
}

/// As a depth sensor's driver publishes its raw colour images.
TEST(BagSource, RectifiesWhatARationalLensTook) {
  const ScratchFolder folder;
  const MessageEncoding cdr = MessageEncoding::kCdr;
  WrittenCameraInfo info = rectified_info(false);
  info.model = "rational_polynomial";
  info.D = {0.2, 0.05, 0, 0, 0.001, 0.5, 0.15, 0.01};
  WrittenBag bag;
  bag.topics = {{"/rgb/image_raw", "sensor_msgs/Image"}, {"/rgb/camera_info", "sensor_msgs/CameraInfo"}};
  cv::Mat ramp(kHeight, kWidth, CV_8UC1);
  for (int u = 0; u < kWidth; ++u) ramp.col(u).setTo(4 * u);
  bag.messages.push_back({1, time_of(0), camera_info_message(cdr, info)});
  bag.messages.push_back({0, time_of(0), image_message(cdr, time_of(0), ramp, "mono8")});
  folder.write("a.mcap", text_of(mcap_file(bag, {})));
  const auto source = open_source(folder / "a.mcap");
  Frame frame;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  const Distortion lens{DistortionModel::kRational, {0.2, 0.05, 0, 0, 0.001, 0.5, 0.15, 0.01}};
  const PinholeCamera& rectified = source->rig().camera;
  for (int u = 2; u < kWidth - 2; u += 5) {
    const Vector2 xy = rectified.unproject(Vector2(u, 20)).head<2>();
    EXPECT_NEAR(frame.left.at<unsigned char>(20, u), 4 * (50 * lens.distort(xy).x() + 32), 1.1) << u;
  }
  const Vector2 rim = rectified.unproject(Vector2(0, 24)).head<2>();
  EXPECT_GT((rim - lens.distort(rim)).norm(), 0.05) << "or this says nothing";
}

/// Depth is 10 ms late, once 20, and once missing.
TEST(BagSource, PairsDepthByTime) {
  const ScratchFolder folder;
  const MessageEncoding ros1 = MessageEncoding::kRos1;
  WrittenBag bag;
  bag.topics = {{"/camera/rgb/image_color", "sensor_msgs/Image"},
                {"/camera/depth/image", "sensor_msgs/Image"},
                {"/camera/rgb/camera_info", "sensor_msgs/CameraInfo"}};
  bag.messages.push_back({2, time_of(0), camera_info_message(ros1, rectified_info(false))});
  for (int i = 0; i < kCount; ++i) {
    const std::int64_t t = time_of(i), late = t + (i == 2 ? 20'000'000 : 10'000'000);
    bag.messages.push_back(
        {0, t, image_message(ros1, t, numbered_image(kWidth, kHeight, i, CV_8UC3), "rgb8")});
    if (i == 3) continue;
    const cv::Mat depth(kHeight, kWidth, CV_32FC1, cv::Scalar(1 + 0.001 * i));
    bag.messages.push_back({1, t, image_message(ros1, late, depth, "32FC1")});
  }
  folder.write("a.bag", text_of(rosbag_file(bag, {})));
  const auto source = open_source("bag:" + (folder / "a.bag"));
  EXPECT_EQ(source->rig().kind, SensorKind::kRgbd);
  Frame frame;
  for (const int i : {0, 1, 4}) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.t_ns, time_of(i));
    EXPECT_EQ(frame.depth.at<std::uint16_t>(5, 5), 1000 + i);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
  EXPECT_EQ(source->report().lost, 3U);  // two colour images, one depth image
  EXPECT_EQ(drain(*open_source("bag:" + (folder / "a.bag") + "?max_gap=0.025")), "4");
  EXPECT_NE(drain(*open_source("bag:" + (folder / "a.bag") + "?max_gap=0.001")).find("parameter max_gap"),
            std::string::npos);
}

/// A depth sensor's two cameras with lenses of their own, as a bag has them that nobody asked for registered
/// depth.
TEST(BagSource, RegistersDepthByTheCalibrationFile) {
  const ScratchFolder folder;
  const MessageEncoding cdr = MessageEncoding::kCdr;
  WrittenBag bag;
  bag.topics = {{"/rgb/image_raw", "sensor_msgs/Image"}, {"/depth/image_raw", "sensor_msgs/Image"}};
  bag.messages.push_back(
      {0, time_of(0), image_message(cdr, time_of(0), numbered_image(kWidth, kHeight, 0), "mono8")});
  const cv::Mat depth(30, 40, CV_16UC1, cv::Scalar(2000));
  bag.messages.push_back({1, time_of(0), image_message(cdr, time_of(0), depth, "16UC1")});
  folder.write("a.mcap", text_of(mcap_file(bag, {})));
  const std::string lens =
      "distortion: {model: rational, coefficients: [0.2, 0.05, 0, 0, 0.001, 0.5, 0.15, 0.01]}";
  folder.write("sensor.yaml",
               "sensor: rgbd\ncameras:\n  - {size: [64, 48], intrinsics: [50, 50, 32, 24], " + lens +
                   "}\ndepth:\n  size: [40, 30]\n  intrinsics: [25, 25, 19.5, 14.5]\n  " + lens +
                   "\n  T_left_depth: [1, 0, 0, -0.03,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]\n");
  SourceOptions options;
  options.calibration = folder / "sensor.yaml";
  const auto source = open_source(folder / "a.mcap", options);
  Frame frame;
  ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
  ASSERT_EQ(frame.depth.size(), cv::Size(kWidth, kHeight));
  for (int v = 4; v < kHeight - 4; v += 4) {
    for (int u = 8; u < kWidth - 8; u += 4)
      EXPECT_EQ(frame.depth.at<std::uint16_t>(v, u), 2000) << u << ", " << v;
  }
}

TEST(BagSource, WithoutCameraInfoACalibrationIsNeeded) {
  const ScratchFolder folder;
  WrittenBag bag = stereo_bag(MessageEncoding::kCdr);
  std::erase_if(bag.messages, [](const WrittenMessage& m) { return m.topic == 2 || m.topic == 4; });
  folder.write("a.mcap", text_of(mcap_file(bag, {})));
  EXPECT_IO_ERROR(open_source(folder / "a.mcap"), "no calibration: give --calib FILE or fx, fy, cx, cy");
  const auto source = open_source("mcap:" + (folder / "a.mcap") + "?fx=50&fy=50&cx=32&cy=24&baseline=0.2");
  EXPECT_EQ(drain(*source), std::to_string(kCount));
  folder.write("calib.txt", "P0: 50 0 32 0 0 50 24 0 0 0 1 0\nP1: 50 0 32 -10 0 50 24 0 0 0 1 0\n");
  SourceOptions options;
  options.calibration = folder / "calib.txt";
  EXPECT_EQ(drain(*open_source(folder / "a.mcap", options)), std::to_string(kCount));
}

TEST(BagSource, TheLeftCameraAloneNeedsNoCalibrationOfTheRightOne) {
  const ScratchFolder folder;
  folder.write("a.mcap", text_of(mcap_file(stereo_bag(MessageEncoding::kCdr), {})));
  SourceOptions options;
  options.calibration =
      folder.write("mono.yaml",
                   "sensor: mono\ncameras:\n  - size: [64, 48]\n    intrinsics: [50, 50, 32, 24]\n"
                   "    distortion: {model: radtan, coefficients: [0.01, 0, 0, 0]}\n");
  EXPECT_IO_ERROR(open_source(folder / "a.mcap", options), "is not for a stereo camera");
  options.left_only = true;
  const auto source = open_source(folder / "a.mcap", options);
  EXPECT_EQ(source->rig().kind, SensorKind::kMono);
  EXPECT_EQ(drain(*source), std::to_string(kCount));
}

/// As EuRoC and TUM-VI publish theirs: two cameras and an inertial sensor, no camera_info.
WrittenBag bag_of_two_cameras(const std::string& pixels) {
  const MessageEncoding ros1 = MessageEncoding::kRos1;
  WrittenBag bag;
  bag.topics = {{"/imu0", "sensor_msgs/Imu"},
                {"/cam1/image_raw", "sensor_msgs/Image"},
                {"/cam0/image_raw", "sensor_msgs/Image"},
                {"/vrpn_client/raw_transform", "geometry_msgs/TransformStamped"}};
  const auto image = [&](int number) {
    cv::Mat grey(kHeight, kWidth, CV_8UC1, cv::Scalar(number));
    if (pixels == "mono16") grey.convertTo(grey, CV_16U, 256);
    return grey;
  };
  for (int i = 0; i < kCount; ++i) {
    const std::int64_t t = time_of(i);
    bag.messages.push_back({0, t, Bytes(300, 1)});
    bag.messages.push_back({1, t, image_message(ros1, t, image(100 + i), pixels)});
    bag.messages.push_back({3, t, Bytes(90, 1)});
    bag.messages.push_back({2, t, image_message(ros1, t, image(10 + i), pixels)});
  }
  return bag;
}

void expect_pairs(const std::string& name, const std::filesystem::path& calibration) {
  EXPECT_IO_ERROR(open_source(name), "no calibration: give --calib FILE");
  SourceOptions options;
  options.calibration = calibration;
  const auto source = open_source(name, options);
  EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
  EXPECT_NEAR(source->rig().baseline, 0.1, 1e-9);
  Frame frame;
  for (int i = 0; i < kCount; ++i) {
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    EXPECT_EQ(frame.t_ns, time_of(i));
    EXPECT_EQ(frame.left.at<unsigned char>(kHeight / 2, kWidth / 2), 10 + i);
    EXPECT_EQ(frame.right.at<unsigned char>(kHeight / 2, kWidth / 2), 100 + i);
  }
  EXPECT_EQ(source->next(frame), FrameStatus::kEnd);
}

TEST(BagSource, EurocsBagsAreReadWithTheFolderOfTheirCalibration) {
  const ScratchFolder folder;
  folder.write("MH_01_easy.bag", text_of(rosbag_file(bag_of_two_cameras("mono8"), {})));
  for (const std::string camera : {"cam0", "cam1"}) {
    folder.write("calib/mav0/" + camera + "/sensor.yaml",
                 "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1, 0, 0, " +
                     std::string(camera == "cam0" ? "0" : "0.1") +
                     ", 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 20\nresolution: [64, 48]\n"
                     "camera_model: pinhole\nintrinsics: [50, 50, 32, 24]\n"
                     "distortion_model: radial-tangential\n"
                     "distortion_coefficients: [-0.28, 0.07, 0.0002, 0.00002]\n");
  }
  expect_pairs(folder / "MH_01_easy.bag", folder / "calib");
}

TEST(BagSource, TumVisBagsAreReadWithKalibrsChain) {
  const ScratchFolder folder;
  folder.write("dataset-room1_512_16.bag",
               text_of(rosbag_file(bag_of_two_cameras("mono16"), {.compression = "lz4"})));
  const std::string camera =
      "  camera_model: pinhole\n  distortion_coeffs: [0.0034, 0.0007, -0.002, 0.0002]\n"
      "  distortion_model: equidistant\n  intrinsics: [24, 24, 32, 24]\n"
      "  resolution: [64, 48]\n";
  folder.write("camchain.yaml",
               "cam0:\n  cam_overlaps: [1]\n" + camera +
                   "  rostopic: /cam0/image_raw\ncam1:\n  T_cn_cnm1:\n"
                   "  - [1, 0, 0, -0.1]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n"
                   "  cam_overlaps: [0]\n" +
                   camera + "  rostopic: /cam1/image_raw\n");
  expect_pairs(folder / "dataset-room1_512_16.bag", folder / "camchain.yaml");
}

/// Blue is the image's number, red where the lens shows another pixel when it is rectified.
cv::Mat colours_of(int number) {
  cv::Mat image(kHeight, kWidth, CV_8UC3);
  for (int u = 0; u < kWidth; ++u) image.col(u).setTo(cv::Scalar(20 * number, 60, 4 * u));
  return image;
}

/// One camera in colour. pixels: an encoding, or the suffix of the files that images are compressed as.
WrittenBag colour_bag(MessageEncoding encoding, const std::string& pixels, const WrittenCameraInfo& info) {
  const bool compressed = pixels.starts_with('.');
  WrittenBag bag;
  const std::string topic = compressed ? "/rgb/image_raw/compressed" : "/rgb/image_raw";
  bag.topics = {{topic, compressed ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image"},
                {"/rgb/camera_info", "sensor_msgs/CameraInfo"}};
  bag.messages.push_back({1, time_of(0), camera_info_message(encoding, info)});
  for (int i = 0; i < kCount; ++i) {
    const std::int64_t t = time_of(i);
    cv::Mat image = colours_of(i);
    if (pixels == "rgb8") cv::cvtColor(image, image, cv::COLOR_BGR2RGB);
    Bytes file;
    if (compressed) cv::imencode(pixels, image, file);
    bag.messages.push_back({0, t,
                            compressed ? compressed_image_message(encoding, t, "bgr8; compressed", file)
                                       : image_message(encoding, t, image, pixels)});
  }
  return bag;
}

std::vector<std::string> write_colour_bags(const ScratchFolder& folder, const std::string& pixels,
                                           const WrittenCameraInfo& info) {
  folder.write("a.mcap", text_of(mcap_file(colour_bag(MessageEncoding::kCdr, pixels, info),
                                           {.compression = "zstd", .chunk_messages = 2})));
  folder.write("a.bag", text_of(rosbag_file(colour_bag(MessageEncoding::kRos1, pixels, info), {})));
  return {"mcap:" + (folder / "a.mcap"), "bag:" + (folder / "a.bag")};
}

TEST(BagSource, GivesTheColoursOfAFrameAfterIt) {
  for (const std::string pixels : {"bgr8", "rgb8", ".png", ".jpg"}) {
    const ScratchFolder folder;
    for (const std::string& text : write_colour_bags(folder, pixels, rectified_info(false))) {
      SCOPED_TRACE(text + " " + pixels);
      for (const bool alone : {false, true}) {
        SourceOptions options;
        options.left_only = options.preload = alone;
        const auto source = open_source(text + "?first=1", options);
        EXPECT_TRUE(alone || source->colour_image(1).empty()) << "it was not delivered";
        EXPECT_EQ(drain(*source), std::to_string(kCount - 1));
        for (const int i : {4, 1, 3}) {
          const cv::Mat colour = source->colour_image(i);
          ASSERT_EQ(colour.type(), CV_8UC3);
          ASSERT_EQ(colour.size(), cv::Size(kWidth, kHeight));
          EXPECT_LE(cv::norm(colour, colours_of(i), cv::NORM_INF), pixels == ".jpg" ? 12 : 0);
        }
        EXPECT_TRUE(source->colour_image(kCount).empty());
        EXPECT_TRUE(source->colour_image(-1).empty());
      }
    }
  }
}

TEST(BagSource, ColoursAreRectifiedAsTheFrameIs) {
  const ScratchFolder folder;
  WrittenCameraInfo info = rectified_info(false);
  info.D = {0.3, 0.1, 0, 0, 0};
  for (const std::string& text : write_colour_bags(folder, "bgr8", info)) {
    const auto source = open_source(text);
    Frame frame;
    ASSERT_EQ(source->next(frame), FrameStatus::kFrame) << source->error();
    const cv::Mat colour = source->colour_image(frame.index);
    ASSERT_EQ(colour.size(), frame.left.size());
    cv::Mat grey;
    cv::cvtColor(colour, grey, cv::COLOR_BGR2GRAY);
    EXPECT_LE(cv::norm(grey, frame.left, cv::NORM_INF), 2);
    EXPECT_GT(cv::norm(colour, colours_of(0), cv::NORM_INF), 8) << "or this says nothing";
  }
}

TEST(BagSource, GreyImagesHaveNoColours) {
  const ScratchFolder folder;
  folder.write("a.mcap", text_of(mcap_file(stereo_bag(MessageEncoding::kCdr), {})));
  const auto source = open_source(folder / "a.mcap");
  EXPECT_EQ(drain(*source), std::to_string(kCount));
  EXPECT_TRUE(source->colour_image(2).empty());
}

/// A file that is written to while it is read.
TEST(BagSource, AMessageThatWasDamagedMeanwhileIsNamed) {
  const ScratchFolder folder;
  for (const std::string& text : write_colour_bags(folder, "bgr8", rectified_info(false))) {
    const auto source = open_source(text);
    EXPECT_EQ(drain(*source), std::to_string(kCount));
    const std::string file = text.substr(text.find(':') + 1);
    std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
    out.seekp(40);
    for (auto left = std::filesystem::file_size(file) - 40; left > 0; --left) out.put('\x55');
    out.close();
    EXPECT_IO_ERROR((void)source->colour_image(3), "(byte ");
  }
}

TEST(BagSource, AFileThatIsCutShortIsSaidToBe) {
  const ScratchFolder folder;
  Bytes file = mcap_file(stereo_bag(MessageEncoding::kCdr), {.chunk_messages = 1, .summary = false});
  file.resize(file.size() * 3 / 4);
  folder.write("a.mcap", text_of(file));
  const auto source = open_source(folder / "a.mcap");
  EXPECT_EQ(drain(*source), "3");
  ASSERT_EQ(source->report().faults.size(), 1U);
  EXPECT_NE(source->report().faults[0].find("a.mcap: is cut short at byte"), std::string::npos);
}

TEST(BagSource, ABagOfDamagedImagesIsRefused) {
  const ScratchFolder folder;
  WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  for (std::size_t i = 1; i < bag.messages.size(); i += 5)  // all right images
    bag.messages[i].data.resize(200);
  folder.write("short.bag", text_of(rosbag_file(bag, {})));
  const std::string end = drain(*open_source(folder / "short.bag"));
  EXPECT_NE(end.find("short.bag: "), std::string::npos) << end;
}

TEST(BagSource, ImagesOfAnotherSizeAreNamed) {
  const ScratchFolder folder;
  WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  bag.messages[8].data =
      image_message(MessageEncoding::kRos1, time_of(1), numbered_image(32, 24, 1), "mono8");
  folder.write("small.bag", text_of(rosbag_file(bag, {})));
  EXPECT_NE(drain(*open_source(folder / "small.bag")).find("small.bag: "), std::string::npos);
}

}  // namespace
}  // namespace twofold
