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

}  // namespace
}  // namespace twofold
