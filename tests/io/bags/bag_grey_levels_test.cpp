// Cameras of 10, 12 or 14 bits in recordings of ROS, whose images are of 16.
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "io/sources/open_source.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

constexpr const char* kCamera = "?fx=50&fy=50&cx=32&cy=24";

/// One image each of these grey levels.
std::string write_bag(const ScratchFolder& folder, const std::vector<int>& levels, bool packed) {
  const MessageEncoding ros1 = MessageEncoding::kRos1;
  WrittenBag bag;
  bag.topics = {{"/cam/image_raw", packed ? "sensor_msgs/CompressedImage" : "sensor_msgs/Image"}};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const std::int64_t t = time_of(static_cast<int>(i));
    const cv::Mat image(kHeight, kWidth, CV_16UC1, cv::Scalar(levels[i]));
    Bytes png;
    if (packed) cv::imencode(".png", image, png);
    bag.messages.push_back({0, t,
                            packed ? compressed_image_message(ros1, t, "mono16; png compressed ", png)
                                   : image_message(ros1, t, image, "mono16")});
  }
  folder.write("a.bag", text_of(rosbag_file(bag, {})));
  return "bag:" + (folder / "a.bag") + kCamera;
}

std::vector<double> greys(FrameSource& source) {
  std::vector<double> grey;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;) grey.push_back(cv::mean(frame.left)[0]);
  EXPECT_EQ(source.error(), "");
  return grey;
}

TEST(BagGreyLevels, TenTwelveOrFourteenBitsAreNotTakenForSixteen) {
  for (const bool packed : {false, true}) {
    for (const int bits : {8, 10, 12, 14, 16}) {
      SCOPED_TRACE(fmt::format("{} bits, {}", bits, packed));
      const ScratchFolder folder;
      const int white = 1 << bits;
      // The first image is a dark one, whatever the camera can do.
      const auto source = open_source(
          write_bag(folder, {white / 16, white / 8, white * 3 / 4, white / 2, white / 4}, packed));
      const std::vector<double> grey = greys(*source);
      ASSERT_EQ(grey.size(), 5U);
      EXPECT_NEAR(grey[0], 16, 1);
      EXPECT_NEAR(grey[2], 192, 1);
      EXPECT_NEAR(grey[4], 64, 1);
      const auto notes = source->report().notes;
      ASSERT_EQ(notes.size(), bits == 16 ? 0U : 1U);
      for (const std::string& note : notes)
        EXPECT_NE(note.find(fmt::format("images of 16 bits hold {}: grey levels were taken from 0 to {}",
                                        bits, white - 1)),
                  std::string::npos)
            << note;
    }
  }
}

/// A bag is not read to its end before it is read: what was dark for long is said when it no longer is.
TEST(BagGreyLevels, WhatGetsBrighterThanEverBeforeIsNotAllWhite) {
  const ScratchFolder folder;
  std::vector<int> levels(310, 200);
  levels.resize(320, 3000);
  const auto source = open_source(write_bag(folder, levels, false));
  const std::vector<double> grey = greys(*source);
  ASSERT_EQ(grey.size(), levels.size());
  EXPECT_NEAR(grey[309], 200, 1);
  EXPECT_NEAR(grey[310], 3000 / 16.0, 1);
  EXPECT_NEAR(grey.back(), 3000 / 16.0, 1);
  ASSERT_EQ(source->report().faults.size(), 1U);
  EXPECT_NE(source->report().faults[0].find("use 12 bits, not 8, from 1700000031.000000000 s on"),
            std::string::npos)
      << source->report().faults[0];
}

}  // namespace
}  // namespace twofold
