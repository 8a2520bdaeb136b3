// Where the colours of surfaces come from: bags, videos, and what is said when there are none.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/twofold/surface/frame_colours.hpp"
#include "fixtures/bag_writer.hpp"
#include "io/files/io_error.hpp"
#include "io/files/mesh_file.hpp"
#include "io/sources/open_source.hpp"
#include "tests/apps/command.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr int kFrames = 40;
constexpr int kRed = 40;

std::string scene(const std::string& sensor) {
  return "synthetic:desk?sensor=" + sensor +
         "&width=320&height=240&noise=1&frames=" + std::to_string(kFrames);
}

/// Bright things are blue, dark ones red, so that no grey image has these colours.
cv::Mat coloured(const cv::Mat& grey) {
  const std::vector<cv::Mat> channels{grey, 0.5 * grey, cv::Mat(grey.size(), CV_8UC1, cv::Scalar(kRed))};
  cv::Mat bgr;
  cv::merge(channels, bgr);
  return bgr;
}

/// Of the scene as a depth camera sees it; `suffix`: of the files that colour images are compressed as, none
/// when empty. Frame `damaged` has a colour image that is cut short.
WrittenBag rgbd_bag(MessageEncoding encoding, const std::string& suffix, int damaged) {
  const auto source = open_source(scene("rgbd"));
  const PinholeCamera& camera = source->rig().camera;
  WrittenBag bag;
  bag.topics = {suffix.empty()
                    ? WrittenTopic{"/camera/rgb/image_rect", "sensor_msgs/Image"}
                    : WrittenTopic{"/camera/rgb/image_rect/compressed", "sensor_msgs/CompressedImage"},
                {"/camera/depth/image_rect", "sensor_msgs/Image"},
                {"/camera/rgb/camera_info", "sensor_msgs/CameraInfo"}};
  WrittenCameraInfo info;
  info.width = static_cast<std::uint32_t>(camera.width);
  info.height = static_cast<std::uint32_t>(camera.height);
  info.K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  info.P = {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0};
  bag.messages.push_back({2, 0, camera_info_message(encoding, info)});
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
    Bytes file;
    if (!suffix.empty()) cv::imencode(suffix, coloured(frame.left), file);
    Bytes image = suffix.empty() ? image_message(encoding, frame.t_ns, coloured(frame.left), "bgr8")
                                 : compressed_image_message(encoding, frame.t_ns, "bgr8; compressed", file);
    if (frame.index == damaged) image.resize(image.size() / 2);
    cv::Mat millimetres;
    frame.depth.convertTo(millimetres, CV_16U, 1000 * source->rig().depth_unit);
    bag.messages.push_back({0, frame.t_ns, image});
    bag.messages.push_back({1, frame.t_ns, image_message(encoding, frame.t_ns, millimetres, "16UC1")});
  }
  return bag;
}

std::string write_bag(const ScratchFolder& folder, bool ros2, const std::string& suffix, int damaged = -1) {
  const MessageEncoding encoding = ros2 ? MessageEncoding::kCdr : MessageEncoding::kRos1;
  const WrittenBag bag = rgbd_bag(encoding, suffix, damaged);
  const Bytes bytes = ros2 ? mcap_file(bag, {.compression = "lz4", .chunk_messages = 7})
                           : rosbag_file(bag, {.compression = "none", .chunk_messages = 7});
  const std::string name = ros2 ? "a.mcap" : "a.bag";
  folder.write(name, {bytes.begin(), bytes.end()});
  return (ros2 ? "mcap:" : "bag:") + (folder / name);
}

void expect_coloured(const std::string& ply) {
  const TriangleMesh mesh = read_ply_mesh(ply);
  ASSERT_EQ(mesh.colours.size(), mesh.positions.size());
  ASSERT_GT(mesh.positions.size(), 1000U);
  int right = 0;
  double brightness = 0;
  for (const auto& [red, green, blue] : mesh.colours) {
    right += std::abs(red - kRed) < 14 && std::abs(green - 0.5 * blue) < 14 ? 1 : 0;
    brightness += blue;
  }
  EXPECT_GT(right, 0.95 * static_cast<double>(mesh.colours.size())) << "JPEG keeps colours coarsely at edges";
  EXPECT_GT(brightness / static_cast<double>(mesh.colours.size()), 60) << "or half of it is red by chance";
}

/// Deterministic, on threads, from memory, and along poses afterwards.
TEST(SurfaceColour, OfABagIsTheBags) {
  const ScratchFolder folder;
  for (const bool ros2 : {true, false}) {
    for (const std::string suffix : {"", ".jpg", ".png"}) {
      const std::string bag = write_bag(folder, ros2, suffix);
      SCOPED_TRACE(bag + " " + suffix);
      const std::string out = folder / "run";
      for (const char* how : {"--deterministic", "--preload --speed 4"}) {
        if (!suffix.empty() && std::string(how) != "--deterministic") continue;
        const Outcome outcome =
            run(folder, "run '" + bag + "' --quiet --surface 0.02 --out '" + out + "' " + how);
        ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
        EXPECT_NE(outcome.out.find("colour: of the recording"), std::string::npos) << outcome.out;
        expect_coloured(out + "/surface.ply");
      }
      const Outcome after =
          run(folder, "surface '" + out + "' --voxel 0.02 --out '" + (folder / "again") + "'");
      ASSERT_EQ(after.exit_code, 0) << after.err;
      expect_coloured(folder / "again/surface.ply");
    }
  }
}

/// A damaged image costs its frame, and the others have their colours.
TEST(SurfaceColour, ADamagedMessageIsSaid) {
  const ScratchFolder folder;
  const std::string bag = write_bag(folder, true, ".jpg", 5);
  const Outcome outcome = run(
      folder, "run '" + bag + "' --quiet --deterministic --surface 0.02 --out '" + (folder / "run") + "'");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("1 damaged images were left out"), std::string::npos) << outcome.out;
  expect_coloured(folder / "run/surface.ply");
}

TEST(SurfaceColour, OfAVideoIsTheVideos) {
  const ScratchFolder folder;
  const std::string file = folder / "pair.avi";
  const auto source = open_source(scene("stereo"));
  const Rig& rig = source->rig();
  cv::VideoWriter writer(file, cv::CAP_FFMPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30,
                         {2 * rig.camera.width, rig.camera.height});
  if (!writer.isOpened()) GTEST_SKIP() << "OpenCV here cannot write MJPEG";
  writer.set(cv::VIDEOWRITER_PROP_QUALITY, 98);
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
    cv::Mat both;
    cv::hconcat(coloured(frame.left), coloured(frame.right), both);
    writer.write(both);
  }
  writer.release();
  const PinholeCamera& c = rig.camera;
  const std::string video = fmt::format("video:{}?layout=side-by-side&fx={}&fy={}&cx={}&cy={}&baseline={}",
                                        file, c.fx, c.fy, c.cx, c.cy, rig.baseline);
  for (const char* how : {"--deterministic", "--preload --speed 4"}) {
    const Outcome outcome =
        run(folder, "run '" + video + "' --quiet --surface 0.02 --out '" + (folder / "run") + "' " + how);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("colour: of the recording"), std::string::npos) << outcome.out;
    expect_coloured(folder / "run/surface.ply");
  }
}

/// A source some of whose frames have a colour image that cannot be read any more.
class ThreeFrames final : public FrameSource {
 public:
  explicit ThreeFrames(std::set<std::int64_t> damaged, bool grey = false)
      : damaged_(std::move(damaged)), grey_(grey) {}
  [[nodiscard]] cv::Mat colour_image(std::int64_t index) const override {
    if (damaged_.contains(index)) throw IoError("some.bag", "is damaged");
    return grey_ ? cv::Mat() : cv::Mat(4, 4, CV_8UC3, cv::Scalar(1, 2, 3));
  }

 private:
  bool read(Frame& /*frame*/) override { return false; }
  std::set<std::int64_t> damaged_;
  bool grey_;
};

std::string said_of(const FrameSource& source, std::vector<std::string>& left_out) {
  FrameColours colours(source);
  for (std::int64_t i = 0; i < 3; ++i) {
    Frame frame;
    frame.index = i;
    frame.left = cv::Mat(4, 4, CV_8UC1, cv::Scalar(7));
    EXPECT_FALSE(colours.left_image(frame).empty());
  }
  left_out.clear();
  colours.add_left_out(left_out);
  return colours.text();
}

TEST(SurfaceColour, WhatIsMissingIsSaidAndGrey) {
  std::vector<std::string> left_out;
  EXPECT_EQ(said_of(ThreeFrames({}), left_out), "of the recording");
  EXPECT_TRUE(left_out.empty());
  EXPECT_EQ(said_of(ThreeFrames({}, true), left_out), "grey: the source gives no other");
  EXPECT_TRUE(left_out.empty());
  EXPECT_EQ(said_of(ThreeFrames({1, 2}), left_out), "of the recording");
  ASSERT_EQ(left_out.size(), 1U);
  EXPECT_EQ(left_out[0], "the colours of 2 images: some.bag: is damaged");
  EXPECT_EQ(said_of(ThreeFrames({0, 1, 2}), left_out), "grey: the source's cannot be read");
  const ThreeFrames one({1});
  FrameColours colours(one);
  Frame frame;
  frame.index = 1;
  frame.left = cv::Mat(4, 4, CV_8UC1, cv::Scalar(7));
  EXPECT_EQ(colours.left_image(frame).type(), CV_8UC1);
  frame.index = 0;
  EXPECT_EQ(colours.left_image(frame).type(), CV_8UC3);
}

}  // namespace
}  // namespace twofold
