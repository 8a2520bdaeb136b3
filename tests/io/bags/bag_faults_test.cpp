// What recorders, drivers and merges do to recordings of ROS.
#include <gtest/gtest.h>

#include "io/sources/open_source.hpp"
#include "tests/io/bags/small_bag.hpp"

namespace twofold {
namespace {

using namespace testing;

/// A driver that was started again, or two bags in one: the same topics, published anew.
WrittenBag begun_anew(WrittenBag bag, int frame) {
  const std::size_t count = bag.topics.size();
  for (std::size_t n = 0; n < count; ++n) bag.topics.push_back(WrittenTopic(bag.topics[n]));
  for (WrittenMessage& message : bag.messages) {
    if (message.t_ns >= time_of(frame)) message.topic += static_cast<std::uint32_t>(count);
  }
  return bag;
}

TEST(BagFaults, TopicsThatBeginAnewAreReadToTheirEnd) {
  const ScratchFolder folder;
  for (const int frame : {3, 0}) {
    const WrittenBag ros2 = begun_anew(stereo_bag(MessageEncoding::kCdr), frame);
    const WrittenBag ros1 = begun_anew(stereo_bag(MessageEncoding::kRos1), frame);
    folder.write("indexed.mcap", text_of(mcap_file(ros2, {})));
    folder.write("plain.mcap", text_of(mcap_file(ros2, {.summary = false})));
    folder.write("indexed.bag", text_of(rosbag_file(ros1, {})));
    folder.write("plain.bag", text_of(rosbag_file(ros1, {.index = false})));
    for (const char* file : {"indexed.mcap", "plain.mcap", "indexed.bag", "plain.bag"}) {
      SCOPED_TRACE(file);
      const auto source = open_source(folder / file);
      EXPECT_EQ(source->rig().kind, SensorKind::kStereo);
      EXPECT_NEAR(source->rig().baseline, 0.2, 1e-12);
      EXPECT_EQ(drain(*source), std::to_string(kCount));
      EXPECT_EQ(source->report().lost, 0U);
    }
  }
}

TEST(BagFaults, ADamagedImageIsAGapTheFirstOneToo) {
  for (const std::size_t left_image : {3, 8}) {
    SCOPED_TRACE(left_image);
    const ScratchFolder folder;
    WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
    bag.messages[left_image].data.resize(200);
    folder.write("short.bag", text_of(rosbag_file(bag, {})));
    const auto source = open_source(folder / "short.bag");
    EXPECT_EQ(drain(*source), std::to_string(kCount - 1));
    const SourceReport report = source->report();
    EXPECT_EQ(report.lost, 2U) << "that image, and its partner";
    ASSERT_EQ(report.faults.size(), 1U);
    EXPECT_NE(report.faults[0].find("short.bag: ends in the middle"), std::string::npos) << report.faults[0];
  }
}

TEST(BagFaults, WithoutAWholeLeftImageABagIsRefused) {
  const ScratchFolder folder;
  WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  for (std::size_t i = 3; i < bag.messages.size(); i += 5) bag.messages[i].data.resize(200);
  folder.write("short.bag", text_of(rosbag_file(bag, {})));
  EXPECT_IO_ERROR(open_source(folder / "short.bag"), "short.bag: ends in the middle");
}

/// Images of one camera, one each at these times.
std::string write_images(const ScratchFolder& folder, const std::vector<int>& times) {
  WrittenBag bag;
  bag.topics = {{"/cam/image_raw", "sensor_msgs/Image"}};
  for (std::size_t i = 0; i < times.size(); ++i) {
    const std::int64_t t = time_of(times[i]);
    bag.messages.push_back({0, time_of(static_cast<int>(i)),
                            image_message(MessageEncoding::kRos1, t,
                                          numbered_image(kWidth, kHeight, static_cast<int>(i)), "mono8")});
  }
  folder.write("a.bag", text_of(rosbag_file(bag, {})));
  return "bag:" + (folder / "a.bag") + "?fx=50&fy=50&cx=32&cy=24";
}

TEST(BagFaults, RepeatedAndSwappedTimesEndNoRun) {
  const ScratchFolder folder;
  const auto source = open_source(write_images(folder, {0, 1, 1, 2, 4, 3, 5, 6}));
  std::vector<int> numbers;
  std::int64_t index = 0;
  for (Frame frame; source->next(frame) == FrameStatus::kFrame;) {
    EXPECT_EQ(frame.index, index++);
    numbers.push_back(frame.left.at<unsigned char>(0, 1));
  }
  EXPECT_EQ(source->error(), "");
  EXPECT_EQ(numbers, (std::vector<int>{0, 1, 3, 4, 6, 7}));
  const SourceReport report = source->report();
  EXPECT_EQ(report.lost, 2U);
  ASSERT_EQ(report.faults.size(), 2U);
  EXPECT_NE(report.faults[0].find("a.bag: an image of '/cam/image_raw' is of 1700000000.100000000 s, not "
                                  "after the one before it"),
            std::string::npos)
      << report.faults[0];
  ASSERT_EQ(report.summary.size(), 1U);
  EXPECT_NE(report.summary[0].find("2 images whose times are out of order were left out"), std::string::npos)
      << report.summary[0];
}

TEST(BagFaults, ManyInARowWhoseTimesDoNotIncreaseEndTheRun) {
  const ScratchFolder folder;
  std::vector<int> times(15);
  for (int i = 0; i < 15; ++i) times[static_cast<std::size_t>(i)] = i < 3 ? 20 + i : i;
  const auto source = open_source(write_images(folder, times));
  const std::string end = drain(*source);
  EXPECT_NE(end.find("not after the one before it"), std::string::npos) << end;
  times.resize(13);  // ten
  EXPECT_EQ(drain(*open_source(write_images(folder, times))), "3");
}

/// The numbers of the images that a source gives, and what it says at its end.
std::string given(FrameSource& source) {
  std::string numbers;
  for (Frame frame; source.next(frame) == FrameStatus::kFrame;)
    numbers += (numbers.empty() ? "" : " ") + std::to_string(frame.left.at<unsigned char>(0, 1));
  return numbers + (source.error().empty() ? "" : " and " + source.error());
}

/// A clock that was set, or bytes that were damaged. A tenth of a second is the usual interval.
TEST(BagFaults, TimesFarInTheFutureCostTheirImagesOnly) {
  const ScratchFolder folder;
  const auto end = [&](const std::vector<int>& times) {
    return given(*open_source(write_images(folder, times)));
  };
  EXPECT_EQ(end({0, 1, 2, 900'000, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}),
            "0 1 2 4 5 6 7 8 9 10 11 12 13 14 15");
  EXPECT_EQ(end({0, 1, 2, 50, 51, 5, 6, 7, 8, 9}), "0 1 2 5 6 7 8 9") << "some in a row";
  EXPECT_EQ(end({900'000, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}), "1 2 3 4 5 6 7 8 9 10 11 12 13 14")
      << "the first one";
  EXPECT_EQ(end({0, 1, 2, 3, 4, 5, 900'000}), "0 1 2 3 4 5") << "the last one";
  EXPECT_EQ(end({0, 1, 2, 3, 4, 50, 51, 52, 53, 54, 55}), "0 1 2 3 4 5 6 7 8 9 10") << "a gap is none";
  EXPECT_EQ(end({0, 1, 2, 3, 4, 50, 51}), "0 1 2 3 4 5 6") << "nor is one near the end";
}

TEST(BagFaults, ATimeFarInTheFutureIsTold) {
  const ScratchFolder folder;
  const auto source = open_source(write_images(folder, {0, 1, 2, 900'000, 4, 5, 6}));
  EXPECT_EQ(given(*source), "0 1 2 4 5 6");
  const SourceReport report = source->report();
  EXPECT_EQ(report.lost, 1U);
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_NE(report.faults[0].find("a.bag: an image of '/cam/image_raw' is of 1700090000.000000000 s, after "
                                  "a later one, of 1700000000.400000000 s"),
            std::string::npos)
      << report.faults[0];
}

/// The partner of an image that is left out is alone; all others stay pairs.
TEST(BagFaults, AFarTimeOfOneCameraOfAPair) {
  const ScratchFolder folder;
  const MessageEncoding ros1 = MessageEncoding::kRos1;
  WrittenBag bag;
  bag.topics = {{"/s/left/image_raw", "sensor_msgs/Image"}, {"/s/right/image_raw", "sensor_msgs/Image"}};
  constexpr int kImages = 30;
  for (int i = 0; i < kImages; ++i) {
    for (const std::uint32_t topic : {0U, 1U}) {
      const std::int64_t t = time_of(i == 10 && topic == 1 ? 900'000 : i);
      bag.messages.push_back(
          {topic, time_of(i), image_message(ros1, t, numbered_image(kWidth, kHeight, i), "mono8")});
    }
  }
  folder.write("a.bag", text_of(rosbag_file(bag, {})));
  const auto source = open_source("bag:" + (folder / "a.bag") + "?fx=50&fy=50&cx=32&cy=24&baseline=0.1");
  EXPECT_EQ(drain(*source), std::to_string(kImages - 1));
  EXPECT_EQ(source->report().lost, 2U);
}

/// The right camera's driver sends an image twice.
TEST(BagFaults, ARepeatedRightImageTakesNoPartner) {
  const ScratchFolder folder;
  WrittenBag bag = stereo_bag(MessageEncoding::kRos1);
  const WrittenMessage right = bag.messages[6];
  bag.messages.insert(bag.messages.begin() + 7, right);
  folder.write("a.bag", text_of(rosbag_file(bag, {})));
  const auto source = open_source(folder / "a.bag");
  EXPECT_EQ(drain(*source), std::to_string(kCount));
  EXPECT_EQ(source->report().lost, 1U);
}

}  // namespace
}  // namespace twofold
